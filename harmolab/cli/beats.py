"""`harmolab beats`: the beats of a song, tracked, read, or tapped by a person."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

import harmolab
from harmolab.cli import common
from harmolab.cli.common import Beats, DanceName, One, Song
from harmolab.cli.screen import finding_beats, wrote

if TYPE_CHECKING:
    from harmolab.types import Audio, FloatArray


Tracker = Literal["librosa", "beat_this"]
TAPPED = ("meter", "port", "no_open")  # options of --tap
FOUND = ("dance", "one", "beats", "clicks", "tracker", "checkpoint")  # options of beats that are found or read


@dataclass(frozen=True)
class TapOptions:
    """Options of a page on which the beats are tapped.

    Parameters
    ----------
    tap : Tap the beats, and mark "one", on a page that only this machine can open. Ten seconds of taps are enough: the
        beats go on to both ends of the song. They keep one tempo; where the song's tempo moves, they follow its sound,
        if that keeps to the taps.
    meter : With --tap: beats in a bar, 3 for a waltz.
    port : With --tap: port of the local page; 0: any free one.
    no_open : With --tap: print the address only.
    """

    tap: Annotated[bool, typer.Option("--tap")] = False
    meter: Annotated[int, typer.Option(min=1, max=32)] = 4
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0
    no_open: Annotated[bool, typer.Option("--no-open")] = False


@common.with_options
def beats(
    context: typer.Context,
    song: Song,
    dance: DanceName = "",
    one: One = None,
    beats: Beats = None,
    out: Path | None = None,
    clicks: Path | None = None,
    tracker: Tracker = "librosa",
    checkpoint: Path | None = None,
    *,
    page: TapOptions,
) -> None:
    """Tell the beats of a song: tempo, how steady it is, where "one" is; hear them (--clicks), tap them (--tap).

    Other commands take the file that it writes with --beats.

    Example: `harmolab beats song.mp3 --dance waltz --one 12.4 --out song.beats --clicks check.wav`

    Example: `harmolab beats song.mp3 --tap --meter 3 --out song.beats`

    Parameters
    ----------
    out : Write the beats, .beats: a line for each, with its time and its place in the bar.
    clicks : Write the song with a click on each beat, .wav.
    tracker : beat_this: a neural network, where its package and a checkpoint are installed.
    checkpoint : File with the weights of beat_this.
    """
    from harmolab.beats.tempo import octave_remark
    from harmolab.clips import song_beats
    from harmolab.readers.audio import load_sound, save_audio
    from harmolab.readers.beats import neural_beats

    common.check_out(out, "a file of beats", (".beats",))
    common.check_out(clicks, "the song with clicks", (".wav",))
    _check_options(context, page, out, tracker)
    audio = load_sound(song)
    if page.tap and out is not None:
        _tapped(song, audio, out, page)
        return
    if tracker == "beat_this":
        track = neural_beats(audio, checkpoint)
    else:
        with finding_beats():
            track = song_beats(audio, dance=dance, beats=beats, one=one)
    text = harmolab.describe_beats(track)
    if out is not None:
        harmolab.save_beats(out, track, comment=f"{song.name}: {text}")
    if clicks is not None:
        save_audio(clicks, harmolab.with_clicks(audio, track))
    typer.echo(text)
    if not dance and track.quality is not None and len(track) > 1:
        typer.echo(octave_remark(track.tempo))
    wrote(out, clicks)


def _check_options(context: typer.Context, page: TapOptions, out: Path | None, tracker: Tracker) -> None:
    """ValueError for an option that goes with --tap only, or without it only, or that another one makes void."""
    common.check_untold(context, FOUND, "goes without --tap only", when=page.tap)
    common.check_untold(context, TAPPED, "goes with --tap only", when=not page.tap)
    neural, is_read = "--tracker beat_this", common.is_told(context, "beats") and not common.is_told(context, "one")
    of_neural = f"goes without {neural}, which finds the beats and the bars itself"
    common.check_untold(context, ("dance", "beats", "one"), of_neural, when=tracker == "beat_this")
    common.check_untold(context, ("checkpoint",), f"goes with {neural} only", when=tracker != "beat_this")
    common.check_untold(context, ("dance", "tracker"), "is of no use to beats that are read", when=is_read)
    common.check_untold(context, ("tap",), "writes what was tapped: name its file, --out song.beats", when=out is None)


def _tapped(song: Path, audio: Audio, out: Path, page: TapOptions) -> None:
    """Write the beats that are tapped on a local page, and print what they are."""
    from harmolab.readers.beats import save_beats, tapped_beats

    def save(taps: FloatArray, ones: FloatArray) -> str:
        result = tapped_beats(audio, taps, ones, meter=page.meter)
        save_beats(out, result.track, comment=f"{song.name}, tapped: {harmolab.describe_beats(result.track)}")
        lines.append(" ".join([f"wrote {out}: {harmolab.describe_beats(result.track)}.", result.remark]).strip())
        return lines[-1]

    from harmolab.lab.listening.local_page import TapServer

    lines: list[str] = []
    common.serve(TapServer(song.name, audio, save, port=page.port), page.no_open, "nothing is written until you save")
    typer.echo("\n".join(lines) or "nothing was saved")
