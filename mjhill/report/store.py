"""The folder with the files of each part: numbers, figure, video."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mjhill.files import check_writable, partial_folder, sweep
from mjhill.report.catalogue import Part

NUMBERS, FIGURE, FILM = ".json", ".png", ".mp4"


@dataclass(frozen=True)
class Store:
    """A folder with up to three files for each part.

    The file of numbers is written last: if it exists, the others are complete.
    """

    folder: Path

    def open(self) -> None:
        """Make the folder if needed, and remove what a killed run has left in it.

        Raises:
            OSError: It cannot be made or written.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        check_writable(self.folder / f"report{NUMBERS}")
        sweep(self.folder)

    def path(self, part: Part, suffix: str) -> Path:
        """Where a file of a part is kept."""
        return self.folder / f"{part.name}{suffix}"

    @contextmanager
    def workplace(self, part: Part) -> Iterator[Path]:
        """A hidden folder to write a part's files to; it is removed at the end."""
        with partial_folder(self.folder, part.name) as folder:
            yield folder

    def keep(self, part: Part, workplace: Path) -> None:
        """Move the files of a part here; they replace older ones."""
        self.path(part, NUMBERS).unlink(missing_ok=True)
        for suffix in (FIGURE, FILM, NUMBERS):
            made = workplace / f"{part.name}{suffix}"
            if made.exists():
                os.replace(made, self.path(part, suffix))

    def read(self, part: Part, fingerprint: str) -> dict[str, Any] | None:
        """The numbers of a part; None if they are missing, damaged, or made from other sources.

        If the numbers mention a film whose file is lost, they come without it.
        """
        try:
            numbers = json.loads(self.path(part, NUMBERS).read_text(encoding="utf-8"))
            same = numbers["fingerprint"] == fingerprint
        except (OSError, ValueError, KeyError, TypeError):
            return None
        if not same or not self.path(part, FIGURE).exists():
            return None
        if "speed" in (numbers["film"] or {}) and not self.path(part, FILM).exists():
            numbers["film"] = None
        return dict(numbers)


def is_finished(part: Part, numbers: dict[str, Any] | None, *, video: bool) -> bool:
    """Whether a part has its numbers and, if it is to be filmed, its film."""
    if numbers is None:
        return False
    film = numbers["film"]
    if not (video and part.entry.filmed):
        return True
    # an experiment that has nothing to film says so; a failed film is tried again
    return film is not None and "problem" not in film


def write_json(path: Path, content: Any) -> None:
    """Write JSON that every reader of JSON can read.

    Raises:
        ValueError: A number is not finite.
    """
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, indent=1)
    path.write_text(text + "\n", encoding="utf-8")
