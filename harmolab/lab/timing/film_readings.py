"""One film, read in both ways: by the body of the dancer, and by the flow of the picture."""

from __future__ import annotations

from typing import Any

import pandas as pd

from harmolab.io.files import PathLike
from harmolab.io.pose_environment import pose_environment
from harmolab.lab.timing.performance import explain_performance, load_performance

BODY, FLOW = "the body", "the flow of the picture"
COLUMNS = ["verdict", "how sure", "offset"]
ABSENT = "not read: what finds bodies is not there (`harmolab pose --install` fetches it)"


def film_readings(song: PathLike, film: PathLike, **settings: Any) -> pd.DataFrame:
    """The verdict on a film by the body of the dancer and by the flow of the picture.

    Parameters
    ----------
    song : str or path
    film : str or path of a video
    **settings : as of `explain_performance`

    Returns
    -------
    DataFrame, a row for `BODY` and `FLOW`: "verdict" (or the reason why there is none), "how sure", "offset".
    """
    rows = (
        {BODY: _reading(song, film, by_flow=False, **settings)} if pose_environment() else {BODY: {"verdict": ABSENT}}
    )
    rows[FLOW] = _reading(song, film, by_flow=True, **settings)
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(COLUMNS)).rename_axis("read").fillna("")


def _reading(song: PathLike, film: PathLike, *, by_flow: bool, **settings: Any) -> dict[str, str]:
    try:
        result = explain_performance(song, load_performance(film, by_flow=by_flow), **settings)
    except ValueError as error:
        return {"verdict": str(error).removeprefix(f"{film}: ")}
    sure = " ".join(result.remarks[:1])
    return {"verdict": result.verdict, "how sure": sure, "offset": str(result.placement)}
