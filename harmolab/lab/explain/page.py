"""One page for a dancer: the verdict, the words, the picture of every beat, the player, the numbers, the doubts."""

import base64
from collections.abc import Iterator
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from harmolab.beats.meter import describe_beats
from harmolab.files import PathLike, write_text
from harmolab.lab.explain.performance import OwnDance
from harmolab.lab.figures.beats import event_name, is_ranked, png_text, ranks_figure, timing_figure
from harmolab.lab.player_data import LONGEST, Dancer, Player
from harmolab.lab.report.templates import rendered
from harmolab.readers.video import video_frames
from harmolab.score import HarmonyScore

WIDE, NARROW = (9.0, 3.6), (4.4, 4.4)  # inches
STRIP_HEIGHT = 200  # pixels
STRIP_COUNT = 8


class Still(NamedTuple):
    """A picture of a video at a music beat: seconds of the video, the picture as base64 of JPEG, and whether a
    movement met the beat."""

    time: float
    jpeg: str
    is_met: bool


def dance_player(dance: OwnDance) -> Player:
    """The player of a dance and its song.

    Parameters
    ----------
    dance : OwnDance
        As `explain_performance` returns it.

    Returns
    -------
    Player, which shows itself in a notebook, and writes its page by `Player.save`

    Raises
    ------
    ValueError
        If the dance is a video of which no body is known, it is longer than the player shows (ten minutes), or it is
        of another kind.
    """
    _check_explained(dance)
    if not dance.performance.has_body:
        raise ValueError(f"{dance.name}: is a video of which no body is known; the player shows bodies")
    dancer = Dancer(dance.name, dance.motion, dance.score)
    return Player(dance.audio, [dancer], music=dance.music, title=_title(dance))


def save_page(path: PathLike, dance: OwnDance) -> None:
    """Write the page about a dance to a file: verdict, words, picture of every beat, player, numbers, doubts.

    It is one HTML file that plays anywhere, written whole or not at all.

    Parameters
    ----------
    path : str or path
    dance : OwnDance
        As `explain_performance` returns it.
    """
    write_text(path, dance_page(dance))


def dance_page(dance: OwnDance) -> str:
    """One HTML page about the agreement of a dance with its song; it needs no network.

    A video has no skeleton to play: of it, pictures at eight music beats are shown, and they are part of the page.

    Raises
    ------
    ValueError
        The video is missing or has changed since it was read, or `dance` is no `OwnDance`.
    """
    _check_explained(dance)
    return explained_page(
        "own_dance.html.j2",
        dance.score,
        numbers=_numbers(dance),
        title=_title(dance),
        dance=dance,
        is_together=dance.is_together,
        verdict=dance.verdict,
        sentences=[*dance.remarks, *dance.judgement.details, *dance.words.sentences],
        wide=_timing_png(dance, WIDE),
        narrow=_timing_png(dance, NARROW),
        player=dance_player(dance).page if dance.motion.duration <= LONGEST and dance.performance.has_body else "",
        longest=LONGEST / 60,
        stills=list(_stills(dance)) if dance.performance.is_video else [],
        event=event_name(dance.score),
        is_ranked=is_ranked(dance.score),
    )


def explained_page(template: str, score: HarmonyScore, *, numbers: dict[str, str], **fields: Any) -> str:
    """A page about a score, with its settings and those numbers that exist."""
    return rendered(
        template,
        numbers={name: text for name, text in numbers.items() if "nan" not in text},
        settings=", ".join(f"{name} {value}" for name, value in vars(score.params).items() if name != "pattern"),
        **fields,
    )


def _check_explained(dance: OwnDance) -> None:
    if not isinstance(dance, OwnDance):
        raise ValueError(f"a dance of explain_performance is needed, got {type(dance).__name__}")


def _title(dance: OwnDance) -> str:
    return " to ".join(dict.fromkeys((dance.name, dance.song)))


def _timing_png(dance: OwnDance, size: tuple[float, float]) -> str:
    """Every beat along time, by its rank or by the distance of the nearest rest or hit, as base64 of PNG."""
    if is_ranked(dance.score):
        return png_text(ranks_figure(dance.score, size=size))
    return png_text(timing_figure(dance.score, means=dance.words.halves, title="", size=size))


def _numbers(dance: OwnDance) -> dict[str, str]:
    """The numbers of the page's table: name -> text."""
    judgement, score = dance.judgement, dance.score
    numbers = {"Level": f"{dance.level} of 4", "p in time": f"{judgement.p_time:.3f}"}
    numbers["p in place"] = f"{judgement.p_place:.3f}" if judgement.is_placed else "nan"
    numbers["Harmony above chance (0: chance, 1: all)"] = f"{score.harmony_above_chance:.2f}"
    numbers["its spread from bar to bar"] = "{:.2f} to {:.2f}".format(*score.interval)
    numbers["Music beats"] = f"{len(dance.music)}: {describe_beats(dance.music)}"
    numbers["Your own tempo"] = f"{judgement.own_tempo:.1f} a minute"
    if judgement.signal is not None and judgement.signal.dimensions:
        numbers["Movement inside the body, of all movement"] = f"{100 * judgement.signal.share:.0f} %"
        numbers["Joints that share in it"] = f"{100 * judgement.signal.joints:.0f} %"
    numbers[f"Moments of {event_name(score)}"] = str(len(score.visual))
    numbers["Length danced to the song"] = f"{dance.motion.duration:.1f} s"
    return numbers


def _stills(dance: OwnDance) -> Iterator[Still]:
    """Pictures of the video at music beats, evenly spread over them."""
    beats, pairs = dance.score.music.times, dance.score.pairs
    if not beats.size:
        return
    video = video_frames(dance.performance.path, height=STRIP_HEIGHT, colour=True)
    places = np.unique(np.linspace(0, beats.size - 1, STRIP_COUNT).round().astype(int))
    frames = {round((beats[place] + dance.skipped) * video.fps): place for place in places}
    for frame, picture in video.at(frames):
        place = frames[frame]
        yield Still(float(beats[place] + dance.skipped), _jpeg(picture), bool(pairs[place] >= 0))


def _jpeg(picture: NDArray[np.uint8]) -> str:
    """An (H, W, 3) RGB picture as base64 of JPEG."""
    _, data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 80])
    return base64.b64encode(data.tobytes()).decode("ascii")
