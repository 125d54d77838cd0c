"""The table of contents of the states of a run: a `.pvd` that ParaView opens as an animation."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Self
from xml.etree import ElementTree

from anmstrip.output.files import replaced
from anmstrip.scene.errors import InputError, Mistake


@dataclass(frozen=True)
class Entry:
    """One state.

    Attributes
    ----------
    time : float
        In the unit of the run (seconds, or a control parameter).
    file : str
        Relative to the `.pvd`.
    """

    time: float
    file: str


class Collection:
    """States in the order of time, rewritten at each addition.

    The file lists only what was added, so that it can be opened at any moment, provided that a
    state is added after it has been written.

    Parameters
    ----------
    path : path
        The `.pvd`.  Nothing is written until the first addition, which replaces what was there.
    entries : sequence of Entry
        What it already lists.
    """

    def __init__(self, path: str | os.PathLike[str], entries: tuple[Entry, ...] = ()) -> None:
        self.path = Path(path)
        self.entries = entries

    @classmethod
    def reopened(cls, path: str | os.PathLike[str], until_time: float) -> Self:
        """Go on with an existing file from a time on; what came later is dropped from it.

        Raises
        ------
        InputError
            The file is there but damaged.
        """
        entries = read(path) if Path(path).exists() else ()
        collection = cls(path, tuple(entry for entry in entries if entry.time <= until_time))
        collection._write()
        return collection

    def add(self, time: float, file: str | os.PathLike[str]) -> None:
        """Add a state that is already on disk.

        Parameters
        ----------
        time : float
            Not before that of the last one.
        file : path
            Its name in the directory of the `.pvd`, or any path to it there.
        """
        self.entries = (*self.entries, Entry(float(time), Path(file).name))
        self._write()

    def _write(self) -> None:
        root = ElementTree.Element("VTKFile", type="Collection", version="0.1")
        parent = ElementTree.SubElement(root, "Collection")
        for entry in self.entries:
            ElementTree.SubElement(
                parent, "DataSet", timestep=repr(entry.time), group="", part="0", file=entry.file
            )
        ElementTree.indent(root)
        with replaced(self.path) as temporary:
            ElementTree.ElementTree(root).write(temporary, "utf-8", xml_declaration=True)


def read(path: str | os.PathLike[str]) -> tuple[Entry, ...]:
    """List the states of a `.pvd`.

    Raises
    ------
    InputError
        It is damaged.
    OSError
        It cannot be read.
    """
    try:
        sets = ElementTree.parse(path).iter("DataSet")
        return tuple(Entry(float(item.attrib["timestep"]), item.attrib["file"]) for item in sets)
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        mistake = Mistake(
            file=str(path),
            key="",
            value=str(error),
            expected="the list of states that a run wrote",
            hint="the same command without --resume",
        )
        raise InputError((mistake,)) from error
