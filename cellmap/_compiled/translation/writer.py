"""The text of one LLVM function while it is written."""

from __future__ import annotations


class Writer:
    """Lines of a function: those of its first block, in which variables get their memory, and those after."""

    def __init__(self, vectors: bool = False) -> None:
        self.again = "" if vectors else ", !llvm.loop !0"  # what a loop says of itself where it begins again
        self.first: list[str] = []
        self.lines: list[str] = []
        self.ended = False  # nothing runs that would be written now
        self._count = 0

    def name(self, prefix: str = "%v") -> str:
        """Return a new name."""
        self._count += 1
        return f"{prefix}{self._count}"

    def write(self, line: str) -> None:
        """Write an instruction without a result."""
        if not self.ended:
            self.lines.append("  " + line)

    def value(self, instruction: str) -> str:
        """Write an instruction; return the register with its result."""
        name = self.name()
        self.write(f"{name} = {instruction}")
        return name

    def memory(self, kind: str, initial: str = "") -> str:
        """Return the address of memory for a register."""
        name = self.name("%m")
        self.first.append(f"  {name} = alloca {kind}")
        if initial:
            self.first.append(f"  store {kind} {initial}, ptr {name}")
        return name

    def label(self) -> str:
        """Return the name of a new block."""
        return self.name("b")

    def begin(self, label: str) -> None:
        """Begin a block; what was written before goes on with it."""
        self.jump(label)
        self.lines.append(f"{label}:")
        self.ended = False

    def jump(self, label: str) -> None:
        """Go on with a block."""
        self.write(f"br label %{label}")
        self.ended = True

    def repeat(self, label: str) -> None:
        """Begin a loop again."""
        self.write(f"br label %{label}{self.again}")
        self.ended = True

    def branch(self, condition: str, then: str, otherwise: str) -> None:
        """Go on with one of two blocks."""
        self.write(f"br i1 {condition}, label %{then}, label %{otherwise}")
        self.ended = True
