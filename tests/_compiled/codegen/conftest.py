import pytest

from cellmap._compiled.codegen.instructions import Instructions, Value


@pytest.fixture
def usual_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out of generated code what it runs for large arguments alone, where it calls the C library."""

    def otherwise(self: Instructions, condition: Value, name: str, arguments: list[Value], usual: Value) -> Value:
        return usual

    monkeypatch.setattr(Instructions, "seldom", otherwise)
