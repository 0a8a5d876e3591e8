"""Which tool is loaded, by what an APT program calls it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from taskcal.programs.apt.syntax import Statement
from taskcal.programs.program import Frame


@dataclass(kw_only=True)
class LoadedTool:
    """Follows the statements that load tools."""

    given: Frame
    """The first one, where it is not among those that are told by name."""
    told: Mapping[str, Frame]
    """Tools by `tool_key`."""
    loaded: Frame
    first: str | None = None
    """Key of the first one that the program loads."""
    loads: bool = False
    """LOAD/TOOL says which tool is loaded; SELECT/TOOL then only brings the next one to the magazine's door."""
    untold: dict[str, Frame] = field(default_factory=dict[str, Frame])
    """Tools of which it is not known where they are, by key."""

    def read(self, statement: Statement) -> bool:
        """Take in a statement; whether it is about tools."""
        words = statement.words
        match statement.word:
            case "LOADTL" | "TOOLNO":
                self._load(words[:1])
            case "TOOL PATH":  # NX: the operation, TOOL, the tool
                self._load(words[2:3] if words[1:2] == ("TOOL",) else words[1:])
            case _ if words[:1] != ("TOOL",):
                return False
            case "LOAD":
                self.loads = True
                self._load(words[1:2])
            case _ if not self.loads:
                self._load(words[1:2])
            case _:
                pass
        return True

    def _load(self, words: tuple[str, ...]) -> None:
        key = tool_key(words[0]) if words else ""
        if self.first is None:
            self.first = key
        if key in self.told:
            self.loaded = self.told[key]
        elif key == self.first:
            self.loaded = self.given
        else:
            untold = Frame(name=key.upper(), T=self.given.T, stated=False)
            self.loaded = self.untold.setdefault(key, untold)


def tool_key(name: str) -> str:
    """How tools are told apart: in small letters, numbers without zeros in front."""
    return str(int(name)) if name.isascii() and name.isdecimal() else name.casefold()
