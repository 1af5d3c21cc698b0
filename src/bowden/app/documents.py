"""What every command prints with ``--json``: the types of which ``bowden schema`` makes the schemas.

A number that does not exist is None. A key that is not always there is `NotRequired`; there are no others.
"""

from typing import Annotated, Any, Literal, NotRequired

from pydantic import ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt
from typing_extensions import TypedDict  # pydantic wants this one before Python 3.12


class Document(TypedDict):
    """What a command prints, or a part of it; the text under a key is its description in the schema."""

    __pydantic_config__ = ConfigDict(extra="forbid", use_attribute_docstrings=True)  # type: ignore[misc]


class _Trust(Document):
    level: Literal["with care", "no"]
    reasons: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]


class _Figure(Document):
    count: PositiveInt
    """Runs that have it."""
    least: float
    q05: float
    """Quantile at 5 %."""
    median: float
    q90: float
    q99: float
    most: float


class _Worst(Document):
    number: NonNegativeInt
    """For --run."""
    value: float | None
    """RMSE from rest [deg]; null where it ran away."""
    drawn: dict[str, float | str]
    """Parameter -> its value in the unit of its name."""


class _Sensitivity(Document):
    parameter: str
    rank_correlation: Annotated[float, Field(ge=-1, le=1)] | None
    """Spearman's; null where it does not exist [1]."""
    variance_share: Annotated[float, Field(ge=0, le=1)] | None
    """Of the variance, between the means of bins of the parameter; null where the law has no such gain [1]."""
    chance_share: Annotated[float, Field(ge=0, le=1)] | None
    """Share below which 95 % of the parameters stay that change nothing, with as many runs; null likewise [1]."""
    above_chance: bool
    """Whether the share is more than that."""


class _Law(Document):
    law: str
    """Its name."""
    runs: PositiveInt
    ran_away: NonNegativeInt
    """Runs that did not reach their end: a command beyond 1000 rad, or no number."""
    unstable: NonNegativeInt
    """Those, and runs in which the joint was further from the reference than its whole stroke (5 deg at least)."""
    unstable_interval: Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(min_length=2, max_length=2)]
    """Wilson's 95 % interval of the share of unstable runs [1]."""
    oscillating: NonNegativeInt | None
    """Runs whose command travelled more than five times as far as the reference, or that ran away; null where runs
    differ in the reference, in a suit and under admittance."""
    worse_than_uncompensated: NonNegativeInt | None
    """Runs with a larger RMSE than the law uncompensated on the same plant; null of that law, and where it did not run.
    """
    figures: dict[str, _Figure]
    """Figure of merit (a column of the rows, with its unit in the name) -> how it is spread over the runs that have it.
    """
    worst: list[_Worst]
    """The runs with the largest RMSE from rest, the worst first; those that ran away before all others."""
    sensitivity: list[_Sensitivity]
    """What the RMSE from rest depends on, the parameter that matters most first; of ranks."""


class _Campaign(Document):
    """What all runs show together."""

    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig whose plants are drawn, with what [set] changes."""
    study: str
    """A hash of all that the rows depend on."""
    rows_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    """SHA-256 of the rows, sorted by number and law; it depends neither on the workers nor on how runs are cut into
    chunks."""
    runs: PositiveInt
    """Plants drawn; each law has run on all of them."""
    laws: list[_Law]
    """One entry for each law, in the order of the study."""
    chunks_computed: NonNegativeInt
    """By this command."""
    chunks_kept: NonNegativeInt
    """That were there before."""
    chunks_set_aside: NonNegativeInt
    """That were there and damaged; they were computed again."""
    files: list[str]
    """The folder of the Parquet files, and the page."""
    seconds: NonNegativeFloat
    """The whole command's, compilation included [s]."""


class _CampaignRunOfLaw(Document):
    law: str
    ended: bool
    """Whether it reached its end; if not, every figure is null."""
    rmse_deg: float | None
    rmse_after_10s_deg: float | None
    peak_deg: float | None
    delay_s: float | None
    hysteresis_width_deg: float | None
    mechanical_energy_j: float | None
    electrical_energy_j: float | None


class _CampaignOneRun(Document):
    """One run alone, with --run."""

    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    run: NonNegativeInt
    """Its number."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    drawn: dict[str, float | str]
    """Parameter -> its value in the unit of its name."""
    runs: list[_CampaignRunOfLaw]
    """One entry for each law."""
    files: list[str]
    """One NPZ file a law, and the page last."""
    seconds: NonNegativeFloat


class _CheckWorst(Document):
    bend_deg: float
    at: str
    """What else differs between the loops: of a suit the elbow's angle, and whether the extensor is taut; else empty.
    """
    slope: float
    """Joint motion per motor motion."""
    estimates: dict[str, float]
    """The law's estimates, in SI units, as they were frozen."""
    largest_pole: NonNegativeFloat
    """Largest magnitude of a closed-loop pole."""


class _LimitCycle(Document):
    predicted: bool
    """Whether the describing function shows a lasting one."""
    amplitude_deg: NonNegativeFloat | None
    """Predicted, half of the span at the joint [deg]."""
    period_s: NonNegativeFloat | None
    """Predicted [s]."""
    confirmed: bool | None
    """Whether the joint swings at rest in simulation by at least a quarter of the prediction; null where nothing was
    predicted or the run ran away."""
    simulated_amplitude_deg: NonNegativeFloat | None
    """Half of the joint's span while the reference rests; null where the run ran away [deg]."""
    simulated_period_s: NonNegativeFloat | None
    """Null where it does not swing to and fro [s]."""


class _Chatter(Document):
    predicted: bool
    """Unstable for one count, stable for the whole stroke."""
    command_per_count_deg: NonNegativeFloat | None
    """Largest change of the command in one cycle for one count of the joint's encoder [deg]; more than 0.5 is chatter.
    """
    simulated_ripple_deg: NonNegativeFloat | None
    """Root mean square of the command's step in one cycle at rest [deg]."""


class _Loop(Document):
    at: str
    """Which cables are taut."""
    gain_margin_db: NonNegativeFloat | None
    """Smallest over all slopes and estimates; null where a loop is unstable or nothing limits it [dB]."""
    phase_margin_deg: NonNegativeFloat | None
    """The same [deg]."""
    delay_margin_s: NonNegativeFloat | None
    """The same, as further delay [s]."""


class _Pair(Document):
    axes: Annotated[list[str], Field(min_length=2, max_length=2)]
    """Names of both axes, the agonist first."""
    co_contraction_deg: float
    """How much further each motor pulls than the joint asks for [deg]."""
    loops: Annotated[list[_Loop], Field(min_length=3, max_length=3)]
    """Smallest margins with both cables taut, and with each alone."""
    motors_apart_deg: NonNegativeFloat | None
    """How far the motors went apart beyond the co-contraction in simulation, each; null where a trial ran away [deg].
    """
    largest_pole_apart: NonNegativeFloat
    """Largest magnitude of a pole with which the motors part while the joint stands: what it comes to is
    motors_apart_deg."""
    law: str
    """Name of the law."""
    holds: bool
    """Whether the loop stays bounded: any verdict but does_not_hold. Exit code 0 where it is true, 1 where it is false.
    """
    verdict: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"]
    """little_margin: below 6 dB or 30 degrees, or chatter that stays bounded, or a trial that does not stand a further
    delay of 7.5 degrees."""
    reason: str
    """What decided."""
    gain_margin_db: NonNegativeFloat | None
    """Smallest over all slopes and estimates; null where a loop is unstable or nothing limits it [dB]."""
    phase_margin_deg: NonNegativeFloat | None
    """The same [deg]."""
    delay_margin_s: NonNegativeFloat | None
    """The same, as further delay [s]."""
    worst: _CheckWorst
    """The linear loop that decides."""
    limit_cycle: _LimitCycle
    """The cycle that backlash can cause."""
    chatter: _Chatter
    """What a steep curve such as tanh(s/ε) does with the encoder's counts."""
    ultimate_bound_deg: NonNegativeFloat | None
    """The paper's Lyapunov bound on the error; null for other laws [deg]."""
    ultimate_bound_s: NonNegativeFloat | None
    """The same on s [rad·s]."""
    simulated_peak_deg: NonNegativeFloat | None
    """Largest error of the trials, for comparison; null where one ran away [deg]."""
    leaves_out: str
    """What the linear loops leave to the trials, which then alone decide whether it holds: of a suit; else empty."""
    refuted: bool
    """A linear loop is unstable where a trial without all that comes to rest: no linear loop stands for the law, and
    its margins are null."""
    advice: str
    """Which number to change, and to what; empty where nothing is to be mended."""


class _CheckOne(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law."""
    holds: bool
    """Whether the loop stays bounded: any verdict but does_not_hold. Exit code 0 where it is true, 1 where it is false.
    """
    verdict: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"]
    """little_margin: below 6 dB or 30 degrees, or chatter that stays bounded, or a trial that does not stand a further
    delay of 7.5 degrees."""
    reason: str
    """What decided."""
    gain_margin_db: NonNegativeFloat | None
    """Smallest over all slopes and estimates; null where a loop is unstable or nothing limits it [dB]."""
    phase_margin_deg: NonNegativeFloat | None
    """The same [deg]."""
    delay_margin_s: NonNegativeFloat | None
    """The same, as further delay [s]."""
    worst: _CheckWorst
    """The linear loop that decides."""
    limit_cycle: _LimitCycle
    """The cycle that backlash can cause."""
    chatter: _Chatter
    """What a steep curve such as tanh(s/ε) does with the encoder's counts."""
    ultimate_bound_deg: NonNegativeFloat | None
    """The paper's Lyapunov bound on the error; null for other laws [deg]."""
    ultimate_bound_s: NonNegativeFloat | None
    """The same on s [rad·s]."""
    simulated_peak_deg: NonNegativeFloat | None
    """Largest error of the trials, for comparison; null where one ran away [deg]."""
    leaves_out: str
    """What the linear loops leave to the trials, which then alone decide whether it holds: of a suit; else empty."""
    refuted: bool
    """A linear loop is unstable where a trial without all that comes to rest: no linear loop stands for the law, and
    its margins are null."""
    advice: str
    """Which number to change, and to what; empty where nothing is to be mended."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""


class _CheckAxes(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    holds: bool
    """Whether the loop stays bounded: any verdict but does_not_hold. Exit code 0 where it is true, 1 where it is false.
    """
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""
    axes: list[
        Annotated[
            dict[str, Any],
            Field(json_schema_extra={"required": sorted(_CheckOne.__required_keys__ - {"seconds"} | {"axis"})}),
        ]
    ]
    """Of a rig with several axes, in place of the figures: those of each that is no part of a pair, with its name as
    axis."""
    pair: NotRequired[_Pair]
    """Of a rig with two motors on one joint ([pair]): both, judged as one. What has the name of a figure above means
    the same."""


class _Confirm(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    drive: str
    """Who the drive is."""
    told_deg: float
    """By how much the joint was seen to go."""
    joint_deg: float
    """By how much it went by its encoder."""
    motor_deg: float
    """By how much the motor went by its encoder."""
    file: str
    """Where it is kept that this drive's angles are confirmed."""
    seconds: float
    """Of the whole command."""


class _Console(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    link: str
    """Opens the console in a browser; who has it controls the rig."""
    rig: str
    """Hash of the rig."""
    twin: bool
    """Whether it runs on a twin of its own."""
    seconds: NonNegativeFloat
    """Until it was ready [s]."""


class _DemoTrust(Document):
    level: Literal["yes", "with care"]
    reasons: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]


class _DemoRun(Document):
    law: str
    rmse_deg: float | None
    """Null where the run was unstable [°]."""


class _Live(Document):
    ended_well: bool
    seconds_led: float
    rmse_deg: float | None
    peak_deg: float | None
    faults: list[str]
    log: str


class _Demo(Document):
    best: str
    """Name of the recommended model, as bowden identify has it."""
    trust: _DemoTrust
    """Whether to trust the model, and why."""
    verdict: Literal["holds", "little_margin", "limit_cycle"]
    """Of the check of the law."""
    runs: list[_DemoRun]
    """Simulated: without compensation first, then with the law."""
    live: _Live
    """The run on the twin, as bowden run has it."""
    files: list[str]
    """Model, rig and page."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Kernel(Document):
    release: str
    preemption: str
    real_time: bool


class _Privilege(Document):
    name: str
    granted: bool
    said: str
    """What holds now, or why it was refused."""
    remedy: str
    """What to change; empty where it was granted."""


class _Lateness(Document):
    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    cycles: int


class _Histogram(Document):
    up_to_us: float | None
    """Upper edge; null for what lies above the last."""
    cycles: int


class _Can(Document):
    kernel: bool
    interfaces: dict[str, str]


class _EmgStreamFound(Document):
    name: str
    source_id: str
    host: str
    channels: int
    rate_hz: float
    """0 where it is irregular."""
    problem: str
    """Why it cannot be used; empty where it can."""


class _EmgFound(Document):
    installed: bool
    streams: list[_EmgStreamFound]
    problem: str
    """Why no streams can be seen; empty where they can."""


class _Doctor(Document):
    kernel: _Kernel
    clock_source: str
    processors: list[int]
    isolated_processors: list[int]
    privileges: list[_Privilege]
    granted: list[_Privilege]
    period_ms: float
    lateness: _Lateness
    histogram: list[_Histogram]
    cyclictest: _Lateness | None
    """Null where it is not installed."""
    can: _Can
    emg: _EmgFound
    advice: list[str]
    seconds: float
    """Of the whole command [s]."""


class _MeanAndDeviation(Document):
    least: float | None
    most: float | None
    last: float | None


class _Silence(Document):
    motor: float | None
    joint: float | None


class _DriveMonitor(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    drive: str
    """Who the drive is."""
    cycles: int
    """How often it was read."""
    motor_deg: _MeanAndDeviation
    """Angle of the motor, at its spool; null where it is not measured."""
    joint_deg: _MeanAndDeviation
    """Angle of the joint; null where it is not measured."""
    current_a: _MeanAndDeviation
    """Motor current; null where it is not measured."""
    tension_n: _MeanAndDeviation
    """Tension of the cable; null where it is not measured."""
    joint_torque_nm: _MeanAndDeviation
    """Torque of the suit on the joint, by a load cell; null where it is not measured."""
    temperature_c: _MeanAndDeviation
    """Of the power stage; null where it is not measured."""
    states: list[str]
    """The drive's states, in their order."""
    silent_s: _Silence
    """Longest time for which an angle did not come; null where it never came."""
    said: list[str]
    """Emergencies that the drive sent, in words."""
    seconds: float
    """Of the whole command."""


class _Device(Document):
    node: int
    what: str
    """What kind of device it is."""
    identity: str
    """Who it is."""
    state: str
    """Of a drive; empty of others."""


class _DriveProbe(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    bus: dict[str, str]
    """Where was looked, and the node of the rig."""
    devices: list[_Device]
    """Who answers, by their numbers."""
    seconds: float
    """Of the whole command."""


class _DriveTare(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    drive: str
    """Who the drive and the load cell are."""
    load: float
    """What is said to hang on the load cell, in `unit`."""
    read: float
    """Mean of what it read with the rig's present zero, in `unit`."""
    span: float
    """Largest less smallest reading, in `unit`."""
    unit: Literal["N", "N·m"]
    """Of the load: N of a tension, N·m of a torque."""
    section: Literal["load_cell", "drive"]
    """Of rig.toml."""
    keys: dict[str, float]
    """Key of that section → value that makes the reading this load; none where it is so already."""
    seconds: float
    """Of the whole command."""


class _DriveZero(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    drive: str
    """Who the drive is."""
    keys: dict[str, float]
    """Key of [drive] → value that makes the present position these angles; none where it is so already."""
    cycles: int
    """How often it was read."""
    motor_deg: _MeanAndDeviation
    """Angle of the motor, at its spool; null where it is not measured."""
    joint_deg: _MeanAndDeviation
    """Angle of the joint; null where it is not measured."""
    current_a: _MeanAndDeviation
    """Motor current; null where it is not measured."""
    tension_n: _MeanAndDeviation
    """Tension of the cable; null where it is not measured."""
    joint_torque_nm: _MeanAndDeviation
    """Torque of the suit on the joint, by a load cell; null where it is not measured."""
    temperature_c: _MeanAndDeviation
    """Of the power stage; null where it is not measured."""
    states: list[str]
    """The drive's states, in their order."""
    seconds: float
    """Of the whole command."""


class _EmgCalibrate(Document):
    rest: float
    """Envelope at rest, in the channel's unit."""
    mvc: float
    """Envelope of the maximum voluntary contraction."""
    sigma: NonNegativeFloat
    """Size at rest as the detector measures it; 0 where it could not be."""
    channel: str
    """Column of the signal."""
    left_out_s: NonNegativeFloat
    """How much was left out: dead electrodes, movement, mains and clicks, with the time in which filters ring after
    them."""
    files: list[str]
    """What was written."""


class _PlainThreshold(Document):
    detections: NonNegativeInt
    """Contractions found."""
    misses: int | None
    """Labelled contractions without a detection, but for rejected ones; null without labels."""
    rejected: int | None
    """Labelled contractions without a detection that are shorter than shortest_ms; null without labels."""
    false_activations: int | None
    """Detections without a label, and each of a contraction after its first; null without labels."""
    latency_median_s: float | None
    """From a label's onset to the detection's; null without any."""
    latency_max_s: float | None
    """The largest of these."""
    false_per_minute: float | None
    """False activations a minute of the recording."""


class _EmgScore(Document):
    detections: NonNegativeInt
    """Contractions found."""
    misses: int | None
    """Labelled contractions without a detection, but for rejected ones; null without labels."""
    rejected: int | None
    """Labelled contractions without a detection that are shorter than shortest_ms; null without labels."""
    false_activations: int | None
    """Detections without a label, and each of a contraction after its first; null without labels."""
    latency_median_s: float | None
    """From a label's onset to the detection's; null without any."""
    latency_max_s: float | None
    """The largest of these."""
    false_per_minute: float | None
    """False activations a minute of the recording."""
    plain_threshold: _PlainThreshold
    """The same for the paper's threshold at 20 % of MVC."""
    contractions_s: list[Annotated[list[float], Field(min_length=2, max_length=2)]]
    """Onset and end of each, in the recording's time."""
    duration_s: float
    """Of the recording."""
    rate_hz: float
    """Samples a second."""
    channel: str
    """Column of the signal."""
    mvc: float
    """Envelope that counts as maximum voluntary contraction, in the channel's unit."""
    mvc_from: str
    """Where it is from."""
    shortest_ms: float
    """Contractions shorter than this are left out; all others are reported this much later."""
    trouble_s: float
    """Time with movement, mains or a dead electrode."""
    warnings: list[str]
    """What was mended or guessed."""
    files: list[str]
    """What was written."""
    seconds: float
    """Time that the command took."""


class _EmgServe(Document):
    source: str
    """What a reader of bowden is given."""
    channels: list[str]
    """Columns of the recording, in the order of the sensors' slots."""
    rate_hz: float
    duration_s: float
    """Of playing it once."""
    seconds: float
    """Until it began [s]."""


class _EmgStream(Document):
    source: str
    """What a reader of bowden is given."""
    name: str
    """Of the stream."""
    source_id: str
    """Identifier by which readers find it again."""
    channels: list[str]
    """Their names."""
    unit: str
    """Of the values; empty where the recording's names have none."""
    rate_hz: float
    """That the stream declares: the recording's, times the speed."""
    duration_s: float
    """Of playing it once."""
    seconds: float
    """Until it began [s]."""


class _CortexM4F(Document):
    code_bytes: NonNegativeInt
    """The law's own functions and constants, without those of the C library [bytes]."""
    state_bytes: NonNegativeInt
    """Its state [bytes]."""
    stack_bytes: NonNegativeInt
    """Most stack that a step needs below its caller, the library's functions included [bytes]."""
    instructions_mean: NonNegativeFloat
    """Instructions of a cycle, mean over the run."""
    instructions_max: NonNegativeFloat
    """Most instructions of a cycle, to within 40."""
    furthest_rad: NonNegativeFloat
    """Largest distance of a command from Python's [rad]."""


class _Export(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law."""
    check: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"] | None
    """What bowden check says of it on this rig; null where it cannot judge the law."""
    precision: Literal["double", "float"]
    """Type of the law's and the detector's numbers; the safety gate's is double."""
    modules: Annotated[list[str], Field(min_length=1)]
    """What was exported, by the name that its files, types and functions begin with; the law first."""
    files: Annotated[list[str], Field(min_length=1)]
    """All files that were written."""
    cortex_m4f: _CortexM4F | None
    """The law on an emulated Cortex-M4F over the recorded run; null where the cross compiler or the emulator is not
    installed."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Model(Document):
    parameters: Annotated[dict[str, float], Field(json_schema_extra={"required": ["slope", "offset"]})]
    """By name; SI and radians. model.toml says what each is and in which unit."""
    uncertainty: Annotated[
        dict[str, NonNegativeFloat | None], Field(json_schema_extra={"required": ["slope", "offset"]})
    ]
    """One standard deviation of each parameter; null where the log does not show it, where it ended at the bound of its
    search, or where none is stated: of a setting that was not fitted, and of generalised_play, whose parameters trade
    with one another."""
    train_rms_deg: NonNegativeFloat | None
    """Error of the joint on the first half, of the family fitted to it [deg]; the parameters are fitted to the whole
    log."""
    test_rms_deg: NonNegativeFloat | None
    """Error of the joint on the second half, of the family fitted to the first [deg]."""


class _Models(Document):
    line: _Model
    play: _Model
    bouc_wen: _Model
    bouc_wen_static: _Model
    prandtl_ishlinskii: _Model
    generalised_play: _Model


class _LoopOfModel(Document):
    slope: float
    """Of the middle half of the stroke [rad/rad]."""
    slope_error: NonNegativeFloat | None
    offset: float
    """Joint angle at motor angle 0 of the line through the middle half [rad]."""
    offset_error: NonNegativeFloat | None
    height: float
    """How far apart both ways are there, at the joint; below zero where the joint leads [rad]."""
    height_error: NonNegativeFloat | None
    rising_place: list[float | None]
    """Motor angles along the stroke while it rises; null where it did not pass [rad]."""
    rising: list[float | None]
    """Joint angles there [rad]."""
    rising_error: list[float | None]
    falling_place: list[float | None]
    """Motor angles while it falls [rad]."""
    falling: list[float | None]
    """Joint angles there [rad]."""
    falling_error: list[float | None]
    curve_error: NonNegativeFloat | None
    """Root mean square of rising_error and falling_error [rad]."""


class _Forecast(Document):
    compensated_rms_deg: NonNegativeFloat | None
    """With the inverse of the recommended model commanded exactly: its error on the second half, weighted by the time
    that the inverse spends at each place [deg]."""
    uncompensated_rms_deg: NonNegativeFloat | None
    """With the inverse of the straight line [deg]."""
    resolution_rms_deg: NonNegativeFloat
    """Of both encoders' counts, at the joint; 0 where the log shows no counts [deg]."""


class _IdentifyTrust(Document):
    level: Literal["yes", "with care", "no"]
    reasons: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]


class _Cycles(Document):
    whole: NonNegativeInt
    more: Annotated[int, Field(ge=0, le=5)]
    """To record; 0 from five cycles on."""
    advice: Annotated[str, Field(min_length=1)] | None
    """What to record and what it may be expected to give; with two and three cycles also how far the stated errors of
    logs as short have been exceeded. Null where nothing is to be recorded."""


class _Identification(Document):
    """Of one log."""

    best: Literal["line", "play", "bouc_wen", "bouc_wen_static", "prandtl_ishlinskii", "generalised_play"]
    """The recommended model; chosen on stretches of the first half that were left out of the fit (of the whole log
    where the first half has fewer than four strokes), never by test_rms_deg."""
    models: _Models
    loop: _LoopOfModel | None
    """Of the recommended model, as it runs along the log; an error is one standard deviation, null where nothing tells
    it. Null where the motor has not gone both ways through the middle of its stroke."""
    forecast: _Forecast
    """Root mean square error of the joint on a motion like the log's second half; the servo is taken to follow at once.
    """
    trust: _IdentifyTrust
    """Whether to trust the recommended model for motions like the log's, the gravest reason first."""
    warnings: list[Annotated[str, Field(min_length=1)]]
    """What the log cannot show, what was mended in it, and what to record instead."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""
    samples: PositiveInt
    """Samples in the log."""
    cycles: _Cycles
    """Whole cycles in the log: as often the motor passed each place in the middle half of its range both ways."""


class _Variables(Document):
    load: NotRequired[str]
    bend: NotRequired[Literal["rad"]]


class _Parameter(Document):
    parameters: dict[str, float]
    """By name; SI and radians. model.toml says what each is and in which unit."""


class _CyclesToIdentify(Document):
    whole: NonNegativeInt
    more: Annotated[int, Field(ge=0, le=5)]
    """To record; 0 from five cycles on."""
    advice: Annotated[str, Field(min_length=1)] | None
    """What to record; null where nothing is."""


class _Log(Document):
    name: str
    samples: PositiveInt
    cycles: _CyclesToIdentify
    """Whole cycles in a log, and how many more to record; of a recalibration, to identify the cable from its log."""
    load: NotRequired[float]
    """Its mean, in the log's unit."""
    bend: NotRequired[float]
    """Its mean [rad]."""
    train_rms_deg: NonNegativeFloat | None
    """Error of the model, which was fitted to this log too [deg]."""
    test_rms_deg: NonNegativeFloat | None
    """On its second half, of a model of all first halves [deg]."""
    same_rms_deg: NonNegativeFloat | None
    """Of a model of all other logs; null where none has its load [deg]."""
    same_offset_rms_deg: NonNegativeFloat | None
    """The same on its second half, the offset fitted to the first [deg]."""
    unseen_rms_deg: NonNegativeFloat | None
    """Of a model of the logs of other loads, with load and bend of all logs but those with both the same; null where
    fewer than two values of either are left [deg]."""
    unseen_offset_rms_deg: NonNegativeFloat | None
    """The same on its second half, the offset fitted to the first [deg]."""


class _JointIdentification(Document):
    """Of several logs fitted together."""

    best: Literal["scheduled"]
    variables: _Variables
    """What the model is scheduled by, and its unit (empty where nothing says it)."""
    models: dict[str, _Parameter]
    logs: Annotated[list[_Log], Field(min_length=2)]
    judged_rms_deg: NonNegativeFloat | None
    """What to expect of another log of this cable once its offset is known [deg]."""
    trust: NotRequired[_IdentifyTrust]
    """Whether to trust the recommended model for motions like the log's, the gravest reason first."""
    warnings: list[Annotated[str, Field(min_length=1)]]
    """What the log cannot show, what was mended in it, and what to record instead."""
    samples: PositiveInt
    """Samples in the log."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""


class _Recalibration(Document):
    """Of a log and the model of another (--model)."""

    best: str
    """The recommended model of that file."""
    gain: PositiveFloat
    """Over the old model's."""
    gain_error: NonNegativeFloat | None
    """Its standard error; null where it is not known."""
    offset_deg: float
    """Added to gain · the old model's joint [deg]."""
    before_rms_deg: NonNegativeFloat | None
    """Error of the old model on this log [deg]."""
    after_rms_deg: NonNegativeFloat | None
    """The same with gain and offset fitted again [deg]."""
    judged_rms_deg: NonNegativeFloat | None
    """Error of the old model on data that it had not seen, as its file says [deg]."""
    changed: bool | None
    """Whether the cable has changed; null where the file does not say how good the model was, and where the motor goes
    outside the identified stroke."""
    models: dict[str, _Parameter]
    trust: NotRequired[_IdentifyTrust | None]
    """Null where neither the old model's file nor the new log says anything."""
    warnings: list[Annotated[str, Field(min_length=1)]]
    """What the log cannot show, what was mended in it, and what to record instead."""
    samples: PositiveInt
    """Samples in the log."""
    cycles: _CyclesToIdentify
    """Whole cycles in a log, and how many more to record; of a recalibration, to identify the cable from its log."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""


class _Fitted(Document):
    value: float
    uncertainty: NonNegativeFloat
    """Standard uncertainty."""


class _IdentifyServo(Document):
    natural_frequency_hz: _Fitted
    """Natural frequency under the position loop [Hz]."""
    damping: _Fitted
    """Damping ratio."""
    delay_s: _Fitted
    """Between the logged command and the moment it acts, fractions of a sample included [s]."""
    delay_cycles: NonNegativeInt
    """The same in cycles of the rig, rounded up."""
    sample_time_ms: PositiveFloat
    """One cycle of the rig [ms]."""
    speed_limit_deg_per_s: _Fitted | None
    """Largest speed; null where the log does not reach it [deg/s]."""
    acceleration_limit_deg_per_s2: _Fitted | None
    """Largest acceleration; null where the log does not reach it [deg/s²]."""
    residual_deg: NonNegativeFloat
    """Root mean square of motor - model [deg]."""
    unexplained: NonNegativeFloat
    """The same as a share of the motor's motion."""
    warnings: list[Annotated[str, Field(min_length=1)]]
    """What was mended in the log: repeated or uneven time stamps."""
    files: list[str]
    """What was written."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Init(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    files: Annotated[list[str], Field(min_length=1)]
    """The rig.toml that was written."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _LogExport(Document):
    files: Annotated[list[str], Field(min_length=1)]
    """The trace."""
    cycles: NonNegativeInt
    """Its rows."""
    columns: list[str]
    """Its columns."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Damage(Document):
    chunks: NonNegativeInt
    """Chunks whose checksum is wrong; their rows are left out."""
    skipped: NonNegativeInt
    """Bytes between records that are none."""
    torn: NonNegativeInt
    """Bytes at the end that are no whole row or record."""


class _Percentiles(Document):
    p50: float
    p99: float
    p99_9: float
    max: float


class _Stop(Document):
    time_s: float
    """Since the first cycle [s]."""
    causes: list[str]
    """The faults that came first."""
    remedies: list[str]
    """What to do about each."""
    consequences: list[str]
    """The faults that came after them or follow from them, in their order."""
    too_busy: str | None
    """That this computer was too busy, or its twin silent, with the figure and what to set; null where neither was."""
    axis: NotRequired[str | None]
    """Of a run with several axes: the axis that the stop came from, whose causes these are; null where it came to all
    at once."""


class _Emergency(Document):
    time_s: float | None
    """Of the cycle in which it came [s]."""
    text: str


class _Gain(Document):
    name: str
    """Of the gain."""
    time_s: float | None
    """When the loop took the change [s]."""
    from_: Annotated[float, Field(alias="from")]
    """Value in force before, in the law's own unit."""
    to: float
    """Value that was asked for."""
    in_force_s: float | None
    """When the law first ran with it, 0.5 s later [s]; null where the log ends before."""


class _Event(Document):
    time_s: float | None
    """Of the cycle in which it shows [s]."""
    text: str


class _LogInfo(Document):
    rig: str | None
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log. null in a log without
    one."""
    file: str
    """The log."""
    closed: bool
    """Whether the recorder ended it properly."""
    whole: bool
    """Whether it was closed and nothing in it changed since."""
    cycles: NonNegativeInt
    """Cycles in the log."""
    missing: NonNegativeInt
    """Cycles before the last of them that are not in it."""
    damage: _Damage
    """What could not be read."""
    duration_s: NonNegativeFloat
    """From the first cycle to the last [s]."""
    begin_s: float | None
    """Column time of the first cycle: zero is when the command began [s]; null in a log without a cycle."""
    sample_time_s: float | None
    """Median time between two cycles; null with fewer than two [s]."""
    start_utc: str
    """When the column time was zero, ISO 8601."""
    law: str | None
    """The law that ran; null where the log does not say."""
    seed: int | None
    """Of the run's random numbers."""
    twin: bool | None
    """Whether the drive was a twin that the command had started itself; null in a log of an earlier version."""
    lateness_s: _Percentiles | None
    """Of the cycles' beginnings; null where it was not recorded [s]."""
    run_time_s: _Percentiles | None
    """Of the cycles' work; null where it was not recorded [s]."""
    overruns: NonNegativeInt | None
    """Deadlines that were skipped; null where they were not recorded."""
    stops: list[_Stop]
    """What stopped the run, in the order of time; also what was acknowledged and gone on from."""
    emergencies: list[_Emergency]
    """What the drive's emergencies meant, with their codes, in their order."""
    gains: list[_Gain]
    """Gains that were changed while the law ran, in the order of time."""
    events: list[_Event]
    """Changes of modes and faults, in their order."""
    software: dict[str, str]
    """Versions, git revisions and host of the run."""
    recorder: dict[str, str]
    """What the recorder said at the end, as text; empty where the log was not closed."""
    columns: dict[str, str]
    """Name of each column and its unit."""
    settings: dict[str, Any]
    """All that made the run; a number that is not finite is null."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""
    axes: NotRequired[dict[str, Annotated[dict[str, Any], Field(json_schema_extra={"required": ["law", "rig"]})]]]
    """Of a run with several axes: name of each, its law and the hash of its rig."""


class _LogPlot(Document):
    files: Annotated[list[str], Field(min_length=1)]
    """The page."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _LogRecover(Document):
    files: Annotated[list[str], Field(min_length=1)]
    """The new log."""
    rows: NonNegativeInt
    """Cycles in it."""
    missing: NonNegativeInt
    """Cycles before the last of them that are lost."""
    missing_seconds: NonNegativeFloat
    """Those cycles' share of the run [s]."""
    tail_seconds: NonNegativeFloat
    """Time that may be missing from the end of the run, on a healthy disk; 0 where the log was closed properly [s]."""
    damage: _Damage
    """What could not be read."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _LogReplayOne(Document):
    rig: str | None
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log. null in a log without
    one."""
    file: str
    """The log."""
    law: str
    """The law that was fed with it."""
    same_law: bool
    """Whether it is the law of the record, with the gains it had."""
    cycles: NonNegativeInt
    """Cycles that were compared."""
    beginnings: NonNegativeInt
    """How often the state was taken from the record: at its begin and after each gap."""
    law_cycles: NonNegativeInt
    """Cycles of those in which the law had the motor."""
    requested_target_largest: NonNegativeFloat | None
    """Largest difference of the requested target from the recorded one; null where the law never led [rad]."""
    requested_target_rms: NonNegativeFloat | None
    """Its root mean square [rad]."""
    first_difference: float | None
    """The record's time at the first requested target that differs [s]."""
    verdicts_differing: NonNegativeInt
    """Cycles with another power, mode, reaction or set of faults, or with a target or torque offset in one of both
    alone."""
    command_largest: NonNegativeFloat
    """Largest difference of the supervisor's target [rad]."""
    first_other_verdict: float | None
    """The record's time at the first verdict that differs [s]."""
    torque_largest: NonNegativeFloat | None
    """Largest difference of the drive's torque offset [N·m]; null in a run without one."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""
    axis: NotRequired[str]
    """With --axis: the name of the one that these figures are of."""


class _LogReplayAxes(Document):
    rig: str | None
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log. null in a log without
    one."""
    file: str
    """The log."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""
    axes: Annotated[
        list[
            Annotated[
                dict[str, Any],
                Field(
                    json_schema_extra={
                        "required": sorted(_LogReplayOne.__required_keys__ - {"file", "seconds"} | {"axis"})
                    }
                ),
            ]
        ],
        Field(min_length=2),
    ]
    """Of a rig with several axes, in place of the figures: those of each, with its name as axis."""


class _Measure(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    log: str
    """The MCAP file."""
    twin: bool
    """Whether the drive was the command's own twin, and not one on the rig's bus."""
    unattended: str | None
    """That the run was ended before its time because the command that started it gave no sign of life, with the figure
    and what to set; null where it was not."""
    ended_well: bool
    """Whether the run ended as asked, not by a fault."""
    mode: str | None
    """The supervisor's last mode; null where the loop failed."""
    faults: list[str]
    remedies: list[str]
    stops: list[_Stop]
    """What stopped the run, in the order of time; also what was acknowledged and gone on from."""
    preflight: str | None
    """Why the preflight failed; null where it did not."""
    emergencies: list[str]
    """What the drive's emergencies meant, with their codes."""
    error: str | None
    """Why the loop ended without a word of its own; null where it did not."""
    cycles_left_out: NonNegativeInt
    """Cycles of the motion that this computer did not let run; their samples are drawn in between their neighbours."""
    files: list[str]
    """The cable's log and the servo's; none where the run did not end well."""
    seconds: float
    """Of the whole command [s]."""


class _Claim(Document):
    id: Annotated[str, Field(pattern="^[a-z0-9_.]+$")]
    """Such as table1.adaptive.constant."""
    source: str
    """Figure, table or equation of the paper."""
    quantity: str
    """What it is, in words."""
    published: float | None
    """Null where the paper prints no number."""
    computed: float | None
    """Null where no such figure exists."""
    interval: tuple[float, float] | None
    """Range of the figure over plausible calibrations, or over the readings that the text allows; null where there is
    one value."""
    unit: str
    verdict: Literal["fitted", "reproduced", "better", "not determined", "differs", "misprint"]
    fitted: bool
    """Whether the calibration used this number."""
    why: str
    """Why the figures differ; given unless the verdict is fitted or reproduced."""


class _Remark(Document):
    id: Annotated[str, Field(pattern="^[a-z0-9_.]+$")]
    source: str
    quantity: str
    computed: float | None
    unit: str
    why: str


class _Reproduce(Document):
    claims: list[_Claim]
    """One entry a published number, or a misprint."""
    remarks: NotRequired[list[_Remark]]
    """Figures of ours on the paper's equations, without a published one."""
    calibrations: NotRequired[list[dict[str, Any]]]
    """What two earlier calibrations predict, by claim; empty with --only."""
    report: NotRequired[str]
    """The HTML report."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""


class _OnsetToCycle(Document):
    p50: float
    p99: float
    max: float


class _RunEmg(Document):
    source: str
    stream: str
    """What the stream says it is."""
    wearer: str | None
    """The wearer's file whose levels the run went by, as rig.toml names it; null without."""
    motions: int | None
    """Motions that contractions began or turned round; null in the proportional mode."""
    onset_to_cycle_ms: _OnsetToCycle | None
    """Until the cycle in which the reference began to move."""
    onset_to_command_ms: _OnsetToCycle | None
    """Until the command had moved by 0.1°."""
    onset_to_joint_ms: _OnsetToCycle | None
    """Until the joint had moved by 1°."""
    peak_after_first_second_deg: float | None
    """Largest error after the first second of each motion."""
    age_ms: _OnsetToCycle | None
    """Age of the newest sample in the loop's cycles."""
    samples: int
    """Samples that came, missing ones included."""
    lost: int
    """Samples that are missing."""
    why_lost: str | None
    """Why nothing came any more at the end; null where the stream was alive."""


class _Interaction(Document):
    rms_nm: NonNegativeFloat
    """RMS of the suit's torque on the elbow less the weight that it is to carry [N m]."""
    peak_nm: NonNegativeFloat
    """Its largest size [N m]."""
    doubt_nm: NonNegativeFloat
    """Median of the standard deviation that the estimate reckons with [N m]."""


class _Axis(Document):
    name: str
    law: str
    rig: str
    """Hash of the axis' own rig."""
    drive: str
    mode: str | None
    faults: list[str]
    preflight: str | None
    """Why its preflight failed; null where it did not."""
    torque: Literal["off", "unknown", "on"]
    seconds_led: NonNegativeFloat
    rmse_deg: NonNegativeFloat | None
    peak_deg: NonNegativeFloat | None
    emergencies: list[str]


class _Run(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law; of several axes with different ones all of them."""
    drive: str
    """Who the drive says it is."""
    twin: bool
    """Whether the drive was the command's own twin, and not one on the rig's bus."""
    unattended: str | None
    """That the run was ended before its time because the command that started it gave no sign of life, with the figure
    and what to set; null where it was not."""
    ended_well: bool
    """Whether the run ended as asked, not by a fault."""
    mode: str | None
    """The supervisor's last mode; null where the loop failed."""
    faults: list[str]
    remedies: list[str]
    stops: list[_Stop]
    """What stopped the run, in the order of time; also what was acknowledged and gone on from."""
    stalled_ms: float | None
    """How long this computer did not let the loop run, where that ended the run [ms]; null where it did not."""
    preflight: str | None
    """Why the preflight failed; null where it did not."""
    emergencies: list[str]
    """What the drive's emergencies meant, with their codes."""
    torque: Literal["off", "unknown", "on"]
    """What the drive has said of its torque at the end: off; on, although it was switched off; unknown, if it has not
    confirmed it: press the emergency stop."""
    error: str | None
    """Why the loop ended without a word of its own; null where it did not."""
    cycles: int | None
    cycles_logged: int
    """Cycles in the log."""
    seconds_led: float | None
    """Time under the law [s]."""
    rmse_deg: float | None
    """Joint against reference under the law, root mean square [°]. Of several axes the largest."""
    peak_deg: float | None
    """Largest error under the law [°]. Of several axes the largest."""
    lateness: _Lateness | None
    run_time_median_us: float | None
    """Of the whole cycle, median [µs]."""
    overruns: int | None
    """Deadlines that were skipped."""
    emg: _RunEmg | None
    """Of a run by EMG; null in any other. Delays count from the sample with which the detector found a contraction."""
    interaction: _Interaction | None
    """What the wearer felt of a suit that follows their push ([admittance]), as the loop estimated it, after the first
    4 s or half of a shorter run; null in any other run."""
    grants: list[_Privilege]
    log: str
    """The MCAP file."""
    more_logs: list[str]
    """Where the recorder had to be started again: what it wrote then, which begins with the last half minute before."""
    log_whole: bool
    """Whether the log was closed properly and every row that was written can be read."""
    log_lost: str | None
    """What became of a log that is not there at the end: removed, replaced or moved; null where it is."""
    seconds: float
    """Of the whole command [s]."""
    axes: NotRequired[Annotated[list[_Axis], Field(min_length=2)]]
    """Of a rig with several axes: each."""


class _Sample(Document):
    files: Annotated[dict[str, str], Field(min_length=1)]
    """Path of each file that was written → what it is; the last one has the numbers behind the others."""
    seed: NonNegativeInt
    """Of the noise."""
    next: str
    """The command to go on with."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _SimulateInteraction(Document):
    rms_nm: NonNegativeFloat
    """RMS of the suit's torque on the elbow less the weight that it is to carry, settled [N m]."""
    peak_nm: NonNegativeFloat
    """Its largest size [N m]."""
    estimate_error_nm: NonNegativeFloat
    """RMS error of the torque that is estimated without a load cell [N m]."""


class _SimulatedRun(Document):
    interaction: _SimulateInteraction | None
    """What the wearer felt of a suit that follows their push ([admittance]); null for any other run."""
    law: str
    """Its name; laws of one name are numbered: adaptive-2."""
    check: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"] | None
    """What bowden check says of it on this rig; null where it cannot judge a law of your own."""
    stable: bool
    """Whether the run reached its end; if not, every figure is null."""
    rmse_deg: NonNegativeFloat | None
    """Root of the mean square of joint - reference, from rest [deg]."""
    rmse_after_10s_deg: NonNegativeFloat | None
    """The same without the first ten seconds; null for a run no longer than that [deg]."""
    peak_deg: NonNegativeFloat | None
    """Largest size of the error [deg]."""
    delay_s: NonNegativeFloat | None
    """The shift of the reference that agrees best with the joint; null where nothing moves [s]."""
    hysteresis_width_deg: NonNegativeFloat | None
    """Height of the loop of joint over reference at mid-stroke; null without a loop [deg]."""
    mechanical_energy_j: float | None
    """Integral of the mechanical power, Eq. 18 [J]."""
    electrical_energy_j: float | None
    """Integral of the electrical power, Eq. 18 [J]."""


class _PairMotor(Document):
    axis: str
    """Its name."""
    largest_pull_nm: NonNegativeFloat | None
    """Largest torque of its cable on the joint [N m]."""
    slack_share: Annotated[float, Field(ge=0, le=1)] | None
    """Share of the run in which its cable was slack."""
    rms_current_a: NonNegativeFloat | None
    """Of its motor [A]."""
    mechanical_energy_j: float | None
    """Integral of the mechanical power, Eq. 18 [J]."""
    electrical_energy_j: float | None
    """Integral of the electrical power, Eq. 18 [J]."""


class _SimulatedPairRun(Document):
    law: str
    """Its name; laws of one name are numbered: adaptive-2."""
    check: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"] | None
    """What bowden check says of it on this rig; null where it cannot judge a law of your own."""
    stable: bool
    """Whether the run reached its end; if not, every figure is null."""
    rmse_deg: NonNegativeFloat | None
    """Root of the mean square of joint - reference, from rest [deg]."""
    rmse_after_10s_deg: NonNegativeFloat | None
    """The same without the first ten seconds; null for a run no longer than that [deg]."""
    peak_deg: NonNegativeFloat | None
    """Largest size of the error [deg]."""
    delay_s: NonNegativeFloat | None
    """The shift of the reference that agrees best with the joint; null where nothing moves [s]."""
    hysteresis_width_deg: NonNegativeFloat | None
    """Height of the loop of joint over reference at mid-stroke; null without a loop [deg]."""
    motors: Annotated[list[_PairMotor], Field(min_length=2, max_length=2)]
    """The agonist first."""


class _SimulatePair(Document):
    axes: Annotated[list[str], Field(min_length=2, max_length=2)]
    """Names of both axes, the agonist first."""
    co_contraction_deg: float
    """How much further each motor pulls than the joint asks for [deg]."""
    runs: Annotated[list[_SimulatedPairRun], Field(min_length=1)]
    """One entry a law, in the order they were asked for; null figures of a run that ran away."""
    files: Annotated[list[str], Field(min_length=3)]
    """Everything that was written; the page comes last."""


class _SimulateOne(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    runs: Annotated[list[_SimulatedRun], Field(min_length=1)]
    """One entry a law, in the order they were asked for."""
    files: Annotated[list[str], Field(min_length=2)]
    """Everything that was written; the page comes last."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""


class _SimulateAxes(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    seconds: NonNegativeFloat
    """Time of the whole command, compilation included [s]."""
    axes: list[Annotated[dict[str, Any], Field(json_schema_extra={"required": ["axis", "rig", "runs", "files"]})]]
    """Of a rig with several axes, in place of the figures: those of each that is no part of a pair, with its name as
    axis."""
    pair: NotRequired[_SimulatePair]
    """Of a rig with two motors on one joint ([pair]): both, simulated as one."""


class _Spread(Document):
    runs: PositiveInt
    unstable: NonNegativeInt
    """As in bowden campaign."""
    unstable_interval: Annotated[list[Annotated[float, Field(ge=0, le=1)]], Field(min_length=2, max_length=2)]
    """Wilson's 95 % interval of their share [1]."""
    rmse_median_deg: float | None
    """From rest; null where that run did not end [deg]."""
    rmse_90_deg: float | None
    """Of nine runs in ten [deg]."""
    rmse_worst_deg: float | None


class _Study(Document):
    name: str
    """Of the study."""
    tuned_on: PositiveInt
    """Plants that the gains were tuned against, its first runs."""
    before: _Spread
    """Over the runs of the study that follow those; a run that did not end counts as the largest RMSE."""
    after: _Spread
    """Over the runs of the study that follow those; a run that did not end counts as the largest RMSE."""


class _Tune(Document):
    trust: NotRequired[_Trust]
    """In the model of the rig's cable; there where it is not yes."""
    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law."""
    preset: str | None
    """The named set of gains on which these stand, written to the file as well; null where there is none."""
    gains: dict[str, float]
    """The gains that were changed, in SI units."""
    before: dict[str, float]
    """The same gains before."""
    verdict: Literal["holds"]
    """Of bowden check."""
    verdict_before: Literal["holds", "little_margin", "limit_cycle", "does_not_hold"]
    """The same of the gains before."""
    gain_margin_db: NonNegativeFloat | None
    """Smallest over slopes and estimates [dB]."""
    phase_margin_deg: NonNegativeFloat | None
    """The same [deg]."""
    delay_margin_s: NonNegativeFloat | None
    """The same [s]."""
    worst_rmse_deg: NonNegativeFloat
    """Largest RMSE over all runs [deg]."""
    worst_rmse_before_deg: NonNegativeFloat | None
    """The same with the gains before; null where a run was unstable [deg]."""
    short: str
    """What these gains fall short of, of what is looked for, and why; empty where they keep it all."""
    study: _Study | None
    """With --study: what the gains make of plants that they were not tuned against; null without."""
    files: list[str]
    """What was written; nothing with --dry-run."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _TwinStarted(Document):
    """Of ``bowden twin RIG``, once it runs."""

    __pydantic_config__ = ConfigDict(  # type: ignore[misc]
        use_attribute_docstrings=True,
        json_schema_extra={
            "additionalProperties": {
                "description": "Where its drive is, as its family tells it: interface, channel, node.",
                "type": "string",
            }
        },
    )

    control: str
    """Socket at which it is talked to."""
    rig: str
    """Hash of the rig."""
    realtime: bool
    """Whether it has real-time priority."""
    seconds: NonNegativeFloat
    """Until it was ready [s]."""


class _TwinState(Document):
    time: float
    """Its clock, the computer's monotonic one [s]."""
    pid: int
    """Its process."""
    state: str
    """Of the drive: SWITCH_ON_DISABLED, OPERATION_ENABLED, FAULT and so on."""
    nmt: NotRequired[int]
    """Of a CANopen drive: its state on the bus, as its heartbeat tells it."""
    torque: bool
    """Whether the motor may have torque."""
    error_code: int
    """Of the fault that it is in; 0 for none."""
    motor: float
    """Angle of the motor at the spool, of a suit in the joint's coordinate [rad]."""
    motor_velocity: float
    """Of the spool [rad/s]."""
    joint: float
    """Angle of the joint [rad]."""
    command: float
    """The target that it follows [rad]."""
    tension: float
    """Of the cable at the spool [N]."""
    current: float
    """Of the motor [A]."""
    interaction: float | None
    """Torque of a suit on the elbow, flexing positive; null of a bench [N·m]."""
    temperature: float
    """Of the power stage [°C]."""
    last_heartbeat: float | None
    """When the host's sign of life came last, on the twin's clock; null for never [s]."""
    syncs: NotRequired[NonNegativeInt]
    """Of a CANopen drive: SYNCs of the host that it has received."""
    unsent: NonNegativeInt
    """Frames that the bus did not take."""
    longest_wait: float
    """Longest time between two looks at the bus [s]."""
    faults: list[str]
    """Those that are there now."""
    processor_share: float
    """Of one processor, since it began [–]."""


class _TwinJournal(Document):
    """With --status, --inject or --clear."""

    twin: _TwinState
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Fault(Document):
    fault: str
    """What to write after --inject."""
    meaning: str
    side: bool
    """Whether joint or motor follows."""
    amount: float | None
    """How much where nothing is said; null where there is nothing to say."""
    unit: str
    """Of the amount."""
    moment: bool
    """Whether it happens once, rather than lasting."""


class _TwinKinds(Document):
    """With --inject list."""

    faults: list[_Fault]
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


class _Schemas(Document):
    schemas: dict[str, str]
    """What there is a schema of, and one line about it."""
    seconds: NonNegativeFloat
    """Time of the whole command [s]."""


DOCUMENTS: dict[str, Any] = {
    "campaign": _Campaign | _CampaignOneRun,
    "check": _CheckOne | _CheckAxes,
    "confirm": _Confirm,
    "console": _Console,
    "demo": _Demo,
    "doctor": _Doctor,
    "drive monitor": _DriveMonitor,
    "drive probe": _DriveProbe,
    "drive tare": _DriveTare,
    "drive zero": _DriveZero,
    "emg calibrate": _EmgCalibrate,
    "emg score": _EmgScore,
    "emg serve": _EmgServe,
    "emg stream": _EmgStream,
    "export": _Export,
    "identify": _Identification | _JointIdentification | _Recalibration,
    "identify-servo": _IdentifyServo,
    "init": _Init,
    "log export": _LogExport,
    "log info": _LogInfo,
    "log plot": _LogPlot,
    "log recover": _LogRecover,
    "log replay": _LogReplayOne | _LogReplayAxes,
    "measure": _Measure,
    "reproduce": _Reproduce,
    "run": _Run,
    "sample": _Sample,
    "schema": _Schemas,
    "simulate": _SimulateOne | _SimulateAxes,
    "tune": _Tune,
    "twin": _TwinStarted | _TwinJournal | _TwinKinds,
}
"""Words of a command → what it prints with ``--json``."""
