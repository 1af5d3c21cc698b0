"""``bowden arm``: the suit on the arm in MuJoCo, as a check of our equations, as pictures and as a video."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, seconds
from bowden.core.files import output_folder, whole_files

if TYPE_CHECKING:
    from bowden.models.suit.arm import Arm
    from bowden.models.suit.geometry import SuitGeometry
    from bowden.sim.arm_agreement import Agreement

MassOption = Annotated[float, typer.Option(help="Of the wearer's body.")]
HeightOption = Annotated[float, typer.Option(help="Of the wearer's body.")]
LoadOption = Annotated[float, typer.Option(help="Held in the hand.")]
HalfWidthOption = Annotated[float, typer.Option(help="a of Eq. 1, half of the arm's width.")]
AnchorOption = Annotated[float, typer.Option(help="b of Eq. 1, from the joint to the anchors.")]
JointOption = Annotated[float, typer.Option(help="R of Eq. 2, round which the extensor runs.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]
OutOption = Annotated[Path, typer.Option(parser=folder_argument, metavar="FOLDER", help="Folder for what is written.")]


def check(
    mass_kg: MassOption = 75.0,
    height_m: HeightOption = 1.75,
    load_kg: LoadOption = 0.0,
    half_width_mm: HalfWidthOption = 35.0,
    anchor_mm: AnchorOption = 85.0,
    joint_radius_mm: JointOption = 50.0,
    out: OutOption = Path("out/arm"),
    json: JsonOption = False,
) -> None:
    """Compare Eqs 1–2, the elbow's dynamics and the simulated suit with MuJoCo's model of the same arm.

    Excursions and moment arms may differ by 0.1 mm over 0–90°, the elbow by 0.5° at any time.
    """
    from bowden.control import LAWS
    from bowden.plants.presets.suit import default_suit
    from bowden.report.arm_page import arm_page
    from bowden.sim.arm_agreement import check_arm

    output_folder(out)
    geometry, arm = _parts(mass_kg, height_m, load_kg, half_width_mm, anchor_mm, joint_radius_mm)
    with progress_bar(quiet=json) as progress:
        suit = default_suit()._replace(geometry=geometry, arm=arm)
        found = check_arm(suit, [LAWS["uncompensated"], LAWS["adaptive"].preset("suit")], progress)
        progress("page", 0.9)
        page = arm_page(geometry, arm, found)
    with whole_files(out) as folder:
        page.write(folder / "check.html")
    document = _document(found) | {"files": [str(out / "check.html")], "seconds": seconds()}
    if json:
        print_json(document)
    else:
        _print(document)


def render(
    trace: Annotated[
        Path | None, typer.Argument(help="A run, as Parquet or CSV of bowden; without one there is no video.")
    ] = None,
    fps: Annotated[float, typer.Option(help="Frames a second of the video.")] = 25.0,
    speed: Annotated[float, typer.Option(help="Seconds of the run in one second of the video.")] = 1.0,
    mass_kg: MassOption = 75.0,
    height_m: HeightOption = 1.75,
    load_kg: LoadOption = 0.0,
    half_width_mm: HalfWidthOption = 35.0,
    anchor_mm: AnchorOption = 85.0,
    joint_radius_mm: JointOption = 50.0,
    out: OutOption = Path("out/arm"),
    json: JsonOption = False,
) -> None:
    """Draw the arm at 0, 30, 60 and 90° with its cables, and a run as a video.

    A run of the suit brings its own geometry and arm, and the options for them then do nothing. A run without tensions
    shows the cables in their full colours.
    """
    from bowden.report.arm_pictures import write_series
    from bowden.report.arm_video import write_video

    output_folder(out)
    run = None if trace is None else _read(trace)
    geometry, arm = _parts(mass_kg, height_m, load_kg, half_width_mm, anchor_mm, joint_radius_mm)
    if run is not None and "flexor_tension" in run.columns:
        from bowden.sim.suit_replay import parts_of

        geometry, arm = parts_of(run)
    files, frames = ["arm.png"], None
    with progress_bar(quiet=json) as progress, whole_files(out) as folder:
        progress("pictures", 0.0)
        write_series(folder / "arm.png", geometry, arm)
        if run is not None and trace is not None:
            files.append(f"{trace.stem}.mp4")
            frames = write_video(folder / files[-1], run, geometry, fps=fps, speed=speed, progress=progress)
    written = [str(out / name) for name in files]
    if json:
        print_json({"frames": frames, "files": written, "seconds": seconds()})
    else:
        print(f"Wrote {' and '.join(written)}  ({seconds():.1f} s)")


def _read(path: Path) -> Any:
    from bowden.core.trace import Trace

    return Trace.from_csv(path) if path.suffix.lower() == ".csv" else Trace.from_parquet(path)


def _parts(
    mass: float, height: float, load: float, half_width: float, anchor: float, radius: float
) -> "tuple[SuitGeometry, Arm]":
    from bowden.models.suit.arm import arm_of
    from bowden.models.suit.geometry import SuitGeometry

    return SuitGeometry(1e-3 * half_width, 1e-3 * anchor, 1e-3 * radius), arm_of(mass, height, load=load)


def _document(found: "Agreement") -> dict[str, Any]:
    from bowden.core.units import DEGREES
    from bowden.sim.arm_check import EXCURSION_LIMIT, MOMENT_ARM_LIMIT, MOTION_LIMIT
    from bowden.sim.mujoco_arm import load_mujoco

    cables = found.cables
    return {
        "verdict": "differs" if found.reasons else "agrees",
        "reasons": found.reasons,
        "flexor": {
            "travel_mm": 1e3 * cables.flexor_travel,
            "excursion_error_mm": 1e3 * cables.flexor,
            "moment_arm_error_mm": 1e3 * cables.flexor_arm,
        },
        "extensor": {
            "travel_mm": 1e3 * cables.extensor_travel,
            "excursion_error_mm": 1e3 * cables.extensor,
            "moment_arm_error_mm": 1e3 * cables.extensor_arm,
            "holds_from_deg": cables.lowest * DEGREES,
        },
        "motions": [
            {"name": one.name, "duration_s": float(one.time[-1]), "error_deg": one.error * DEGREES}
            for one in found.motions
        ],
        "convergence": [
            {
                "motion": name,
                "integrator": one.integrator,
                "steps_s": list(one.steps),
                "errors_deg": [error * DEGREES for error in one.errors],
                "order": one.order,
            }
            for name, one in found.convergences
        ],
        "limits": {
            "excursion_mm": 1e3 * EXCURSION_LIMIT,
            "moment_arm_mm": 1e3 * MOMENT_ARM_LIMIT,
            "motion_deg": MOTION_LIMIT * DEGREES,
        },
        "mujoco": str(load_mujoco().__version__),
    }


def _print(document: dict[str, Any]) -> None:
    print(f"{'':14}{'travel':>10}{'excursion':>14}{'moment arm':>14}   differences from Eqs 1–2, in mm")
    for name in ("flexor", "extensor"):
        one = document[name]
        errors = f"{one['excursion_error_mm']:>14.1e}{one['moment_arm_error_mm']:>14.1e}"
        print(f"{name:14}{one['travel_mm']:>10.2f}{errors}")
    print(f"Eq. 2 holds from {document['extensor']['holds_from_deg']:.1f}° on")
    for one in document["motions"]:
        print(f"{one['name']:20}{one['duration_s']:>3.0f} s   largest difference of the elbow {one['error_deg']:.1e}°")
    for one in document["convergence"]:
        print(f"{one['motion']:20}{one['integrator']:>7}   order {one['order']:.2f} in MuJoCo's time step")
    print(f"MuJoCo {document['mujoco']} {document['verdict']}" + "".join(f"; {one}" for one in document["reasons"]))
    print(f"\nPage: {document['files'][0]}  ({document['seconds']:.1f} s)")


GROUP = "The suit on the arm in MuJoCo: a check, pictures, a video."

COMMANDS = (
    Command(
        "arm check",
        check,
        "Compare the suit's geometry and elbow with MuJoCo's.",
        (
            "bowden arm check",
            "bowden arm check --mass-kg 120 --height-m 1.9 --load-kg 2 --json",
        ),
        place=10,
    ),
    Command(
        "arm render",
        render,
        "Draw the suit on the arm, and a run as a video.",
        (
            "bowden arm render",
            "bowden arm render out/simulate/adaptive.parquet --speed 2 --out out/arm",
        ),
        place=20,
    ),
)
