"""What the tests share."""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import settings

os.environ["LSLAPICFG"] = str(Path(__file__).parent / "lsl_api.cfg")  # liblsl reads it once, when it is first used
settings.register_profile("bowden", deadline=None, derandomize=True)  # compilation is slow, and a run repeats another
settings.load_profile("bowden")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell starts what runs in its background deaf to interruptions, and every child of it too
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recordings that lies beside the project, where it is there."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings in ../shared/data are not here")
    return folder
