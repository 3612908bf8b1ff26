"""Notes of a piece as a table of text, ``notes.csv``.

=============  ===================================================================================
column         content
=============  ===================================================================================
``onset_s``    seconds of audio time at which the note begins
``offset_s``   seconds at which it ends
``midi``       key, a MIDI number: 60 is middle C
``loudness``   0 to 1; optional, 1 where there is no such column. MIDI velocities divided by 127
``hand``       left or right, empty where unknown; optional
=============  ===================================================================================

The first line has the names, in any order; other columns are not read. MIDI files are not read: any notation program
or MIDI library writes such a table.
"""

from __future__ import annotations

import numpy as np

from harmolab.io.files import MAX_TEXT_BYTES, PathLike, reading, write_text
from harmolab.io.tables import number_column, read_columns
from harmolab.types import Notes

_NEEDED = ("onset_s", "offset_s", "midi")
_COLUMNS = (*_NEEDED, "loudness", "hand")
_HANDS = {"left": 0, "right": 1, "": -1}


def load_notes(path: PathLike) -> Notes:
    """The notes in a table, in the order of their onsets.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    with reading(path, "a table of notes", max_bytes=MAX_TEXT_BYTES) as file:
        columns = read_columns(file, _NEEDED)
        onsets, offsets, keys = (np.array(number_column(columns, name)) for name in _NEEDED)
        bad = ~(np.isfinite(keys) & (keys == np.round(keys)) & (keys >= 0) & (keys <= 127))
        if bad.any():
            raise ValueError(
                f"midi must be whole numbers from 0 to 127, got {columns['midi'][int(bad.argmax())][:30]!r}"
            )
        loudness = np.array(number_column(columns, "loudness")) if "loudness" in columns else np.ones(keys.size)
        if loudness.size and 1 < loudness.max() <= 127:
            raise ValueError(f"loudness reaches {loudness.max():g}; these are MIDI velocities: divide them by 127")
        words = [word.lower() for word in columns.get("hand", [""] * keys.size)]
        if unknown := [word for word in words if word not in _HANDS]:
            raise ValueError(f"hand must be left, right or empty, got {unknown[0][:30]!r}")
        hands = np.array([_HANDS[word] for word in words], np.int64)
        order = np.argsort(onsets, kind="stable")
        return Notes(onsets[order], offsets[order], keys.astype(np.int64)[order], loudness[order], hands[order])


def save_notes(path: PathLike, notes: Notes) -> None:
    """Write notes as a table that `load_notes` reads back to the last bit; whole or not at all."""
    names = {number: name for name, number in _HANDS.items()}
    arrays = (notes.onsets, notes.offsets, notes.pitches, notes.loudness)
    rows = zip(*(array.tolist() for array in arrays), [names[hand] for hand in notes.hands.tolist()], strict=True)
    write_text(path, "\n".join([",".join(_COLUMNS), *(",".join(map(str, row)) for row in rows)]) + "\n")
