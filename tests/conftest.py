"""What the tests share."""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("bowden", deadline=None, derandomize=True)  # compilation is slow, and a run repeats another
settings.load_profile("bowden")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recordings that lies beside the project, where it is there."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings in ../shared/data are not here")
    return folder
