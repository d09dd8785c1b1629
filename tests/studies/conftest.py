"""What tests of studies share: no window is opened, and one way to run a study quickly."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import matplotlib as mpl
import pytest

mpl.use("Agg")


@pytest.fixture
def quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a study quickly, which must leave the files named and no others; return what it prints."""

    def printed(study: ModuleType, *files: str) -> str:
        study.main(quick=True, output=tmp_path)
        assert sorted(p.name for p in tmp_path.iterdir()) == sorted(files)
        return capsys.readouterr().out

    return printed
