"""`harmolab perform`: the sound of an instrument in, a musician who plays it out."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Annotated, Literal

import typer

import harmolab
from harmolab import musician
from harmolab.cli.common import PAGES, VIDEOS_OUT, Fps, Offset, Song, check_output, say_begin
from harmolab.cli.dancing import files_to_write, written
from harmolab.cli.screen import note, progress, say, waiting, wrote
from harmolab.cli.training import TRAIN_HINT
from harmolab.files import named_faults

Instrument = Literal["piano", "violin"]
UNASKED = (".html", ".mp4")  # where nothing is asked for


def perform(
    context: typer.Context,
    song: Song,
    instrument: Annotated[Instrument | None, typer.Option(show_default=False)] = None,
    out: Path | None = None,
    weights: Path | None = None,
    is_avatar: Annotated[bool | None, typer.Option("--avatar/--points", show_default=False)] = None,
    start: float = 0.0,
    seconds: float | None = None,
    truth: Path | None = None,
    offset: Offset = None,
    fps: Fps = None,
) -> None:
    """Show a musician who plays a recording, as points or as an avatar, from the sound of a piano or a violin alone.

    **The players that come with harmolab were trained on planted, synthetic players only**: a program moved their hands
    by the notes. They show what such a network can hear, not how a person plays. This is said on everything that is
    made with them. Train one on musicians of your own:

        harmolab train FOLDER --system audio2body --out RUN

        harmolab perform SONG --weights RUN

    Marks on the page are the onsets of the notes, found in the sound by a program, and the strikes of the fingers or
    turns of the bow. An error is printed only where the truth is known (--truth). To look at your own playing alone:
    `harmolab score SONG POINTS --instrument piano --why page.html`.

    Example: `harmolab perform sonata.wav --instrument piano`

    Example: `harmolab perform take/audio.wav --instrument violin --truth take --points --out beside.html`

    Parameters
    ----------
    instrument : Instrument that is played; may be left out with --weights.
    out : html (a page that plays it), mp4 or webm (with sound), npz, or bvh (Blender). Left out: SONG_performance.html
        and .mp4 in this folder.
    weights : Folder of `harmolab train --system audio2body`, or a weights file.
    is_avatar : An avatar in space with its instrument, or the 2-D points. Left out: the points in an npz, else the
        avatar.
    start : Audio time in seconds at which the performance begins.
    seconds : Take only so many seconds from there.
    truth : Your own playing of SONG: a folder of a performance, or a file or folder of key points. It is shown beside
        the predicted playing (with --points: under it), with the error, and how well both meet the sound.
    offset : With --truth: audio time in seconds at which your playing begins (default: what its file or folder says,
        else 0).
    fps : With --truth: frame rate of your playing, where its files do not hold it.
    """
    paths = files_to_write(out, song, "performance", UNASKED)
    for path in paths:
        check_output(context, path)
    if truth is None and (offset is not None or fps is not None):
        raise ValueError("--offset and --fps are those of --truth; leave them out without it")
    is_avatar = _is_avatar(is_avatar, paths)
    system = _player(weights, instrument)
    from harmolab.musician.performances import load_playing

    with waiting("listening"):
        audio = harmolab.load_sound(song, sample_rate=None)
        begin = perf_counter()
        plays = partial(load_playing, instrument=system.network.instrument, offset=offset, fps=fps, film=song)
        own = None if truth is None else plays(truth, audio)
        with named_faults(song):
            result = musician.performed(
                system, audio, start=start, seconds=seconds, is_avatar=_has_body(system, is_avatar), truth=own
            )
        length, took = result.figure.duration, perf_counter() - begin
    used = str(weights) if weights else f"the {result.instrument} player that comes with harmolab"
    done = written(
        paths, lambda path: _write(path, result, title=f"{song.name}: {result.instrument}", used=used),
        is_asked=out is not None,
    )  # fmt: skip
    if not len(result.sound):
        note(f"no note is heard in these {length:.2f} s of {song}: what moves is only the player at rest")
    say(f"{length:.2f} s from {result.start:.2f} s of {song} on, played in {took:.2f} s by {used}", result.notice)
    say(*_beside(result))
    wrote(*done)
    say_begin(result.start, *(path for path in done if path.suffix.lower() == ".bvh"))


def _is_avatar(is_avatar: bool | None, paths: list[Path]) -> bool:
    """True where an avatar is drawn or kept; ValueError where a BVH is to hold points of a picture."""
    if is_avatar is None:
        return any(path.suffix.lower() != ".npz" for path in paths)
    if not is_avatar and (flat := [path for path in paths if path.suffix.lower() == ".bvh"]):
        raise ValueError(f"{flat[0]}: BVH holds movement in space; leave out --points, or save the points as .npz")
    return is_avatar


def _player(weights: Path | None, instrument: Instrument | None) -> musician.Audio2Body:
    """The shipped player of an instrument, or that of a run.

    Raises
    ------
    FileNotFoundError, ValueError
        For weights that are not there, damaged, of another system or of another instrument.
    """
    if weights is None and instrument is None:
        raise ValueError("say what is played: --instrument piano or --instrument violin")
    from harmolab.systems.contract import maker_of

    if weights is not None and (name := maker_of(weights)) != "audio2body":
        raise ValueError(f"{weights}: was made by the system {name!r}, which plays no instrument; see `harmolab dance`")
    try:
        player = musician.Audio2Body
    except ModuleNotFoundError as error:
        raise ValueError(f"playing needs {error.name}; {TRAIN_HINT}") from None
    system = player.load(weights) if weights is not None else player.shipped(instrument or "")
    plays = system.network.instrument
    if instrument not in (None, plays):
        raise ValueError(f"{weights}: plays the {plays}, not the {instrument}; leave out --instrument")
    if system.network.params.hears == "notes":
        raise ValueError(f"{weights}: hears notes, not sound; in Python: Audio2Body.load(RUN).generate(audio, notes=)")
    return system


def _has_body(system: musician.Audio2Body, is_avatar: bool) -> bool:
    """An avatar is asked for and can be built; a note says where it cannot."""
    if is_avatar and "left_shoulder" not in system.network.skeleton.joints:
        note("these points are hands without a body, of which no avatar can be built: the points are shown")
        return False
    return is_avatar


def _write(path: Path, result: musician.Performed, *, title: str, used: str) -> None:
    """Write the kind of file that a name asks for."""
    suffix = path.suffix.lower()
    if suffix in PAGES:
        musician.save_performed(path, result, title=title, facts={"player": used})
    elif suffix in VIDEOS_OUT:
        from harmolab.musician.video import write_performance

        write_performance(path, result, title=title, progress=progress)
    else:
        harmolab.save_motion(path, result.figure, offset=result.start, about=result.notice)


def _beside(result: musician.Performed) -> list[str]:
    """Error and score of the prediction, and the score of the truth; nothing without a truth."""
    if result.truth is None:
        return []
    own, true = result.words, result.truth.words
    truth = (f"The truth: {true.verdict}", *true.sentences)
    return [*result.errors, f"From the sound: {own.verdict}", *own.sentences, *truth]
