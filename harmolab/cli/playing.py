"""`harmolab play`: a motion and its music as one page that plays anywhere."""

from __future__ import annotations

from math import ceil, inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli.common import PAGES, check_out, finding_beats, plain_errors

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harmolab.types import Audio, BeatTrack, Clip, Motion


def play(
    audio: Annotated[Path, typer.Argument(help="The music: wav, flac, ogg or mp3, or a video with sound.")],
    motion: Annotated[
        Path, typer.Argument(help="The motion: npz, npy, bvh, AIST++ pkl, keypoints, or a Tang 2018 folder.")
    ],
    out: Annotated[Path, typer.Option(help="The page to write, .html.")],
    other: Annotated[Path | None, typer.Option(help="A second motion to the same music, shown beside it.")] = None,
    offset: Annotated[
        float | None,
        typer.Option(help="Audio time in seconds of the motions' first frame (default: what the folder says, else 0)."),
    ] = None,
    start: Annotated[
        float | None, typer.Option(help="Audio time in seconds at which the page begins (default: with the motion).")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="Show only so many seconds from there.")] = None,
    dance: Annotated[str, typer.Option(help="Dance of the music: a prior for its tempo (waltz, ...).")] = "",
    beats: Annotated[
        Path | None, typer.Option(help="Beat annotation (.beats, csv, beats.json) in place of beat tracking.")
    ] = None,
    fps: Annotated[
        float | None, typer.Option(help="Frame rate, for files that do not hold it (npy, keypoints).")
    ] = None,
) -> None:
    """Write a page that plays a motion to its music: beats, hits and misses on a time line, slow motion, loops, clicks.

    Example: `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`
    """
    from harmolab.beats.audio import music_beats
    from harmolab.data.files import load_clip
    from harmolab.io.video_sound import load_sound

    with plain_errors():
        check_out(out, "the player", PAGES)
        with finding_beats():
            clip = load_clip(audio, motion, offset=offset, dance=dance, beats=beats, fps=fps)
        names, motions = _motions(clip, motion, other, fps)
        motions, begins = _shown(motions, clip.offset, start, seconds)
        sound = load_sound(audio, start=begins, duration=max(moves.duration for moves in motions), sample_rate=None)
        _save(
            out, f"{clip.name} to {audio.name}", sound, music_beats(clip).span(begins, sound.duration), names, motions
        )
    typer.echo(f"wrote {out}")


def _motions(clip: Clip, path: Path, other: Path | None, fps: float | None) -> tuple[list[str], list[Motion]]:
    """Names and motions of the dancers, all at the rate of the first: one frame of each falls on the same moment."""
    from harmolab.data.folders import load_any_motion
    from harmolab.kinematics import resample_motion, upsample_motion

    first = clip.motion or load_any_motion(path, fps=fps)
    if other is None:
        return [clip.name], [first]
    second = upsample_motion(load_any_motion(other, fps=fps), first.fps)
    return [clip.name, other.stem or other.name], [first, resample_motion(second, first.fps)]


def _shown(
    motions: list[Motion], offset: float, start: float | None, seconds: float | None
) -> tuple[list[Motion], float]:
    """The frames from audio time `start` on, and the audio time of the first of them."""
    if seconds is not None and not 0 < seconds < inf:
        raise ValueError(f"seconds must be positive and finite, got {seconds:g}")
    if start is not None and not isfinite(start):
        raise ValueError(f"start must be a finite number of seconds, got {start:g}")
    fps = motions[0].fps
    # The first whole frame there, and the sound from that very moment: not up to half a frame apart.
    skipped = max(ceil((max(offset if start is None else start, 0.0) - offset) * fps - 1e-9), 0)
    return [motion.span(skipped / fps, seconds or motion.duration) for motion in motions], offset + skipped / fps


def _save(
    out: Path, title: str, sound: Audio, track: BeatTrack, names: Sequence[str], motions: Sequence[Motion]
) -> None:
    """The page, with what each dancer scores."""
    from harmolab.harmony import score_motion
    from harmolab.params import HarmonyParams
    from harmolab.widgets.player import Dancer, Player

    params, dancers, facts = HarmonyParams.valleys(), [], {}
    duration = max(motion.duration for motion in motions)
    for name, motion in zip(names, motions, strict=True):
        score = score_motion(track.span(0.0, duration), motion, params=params)
        facts[f"{name}: harmony above chance"] = f"{score.harmony_above_chance:.2f} (p = {score.p_value:.3f})"
        dancers.append(Dancer(name, motion, score))
    Player(sound, dancers, music=track, title=title, facts=facts).save(out)
