"""`harmolab beats` and `harmolab tap`: the beats of a song, tracked, read, or tapped by a person."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from harmolab.cli import common
from harmolab.cli.common import Beats, DanceName, One, Song
from harmolab.cli.screen import finding_beats, plain_errors, wrote

if TYPE_CHECKING:
    from harmolab.types import Audio, BeatTrack, FloatArray


Tracker = Literal["librosa", "beat_this"]


def beats(
    song: Song,
    dance: DanceName = "",
    one: One = None,
    beats: Beats = None,
    out: Path | None = None,
    clicks: Path | None = None,
    tracker: Tracker = "librosa",
    checkpoint: Path | None = None,
) -> None:
    """Tell the beats of a song: tempo, how steady it is, where "one" is; hear them with --clicks.

    What it writes, other commands take with --beats. Where it is wrong, `harmolab tap` lets you tap.

    Example: `harmolab beats song.mp3 --dance waltz --one 12.4 --out song.beats --clicks check.wav`

    Parameters
    ----------
    out : Write them, .beats: lines of time and place in the bar.
    clicks : Write the song with a click on each beat, .wav.
    tracker : beat_this: a neural network, where its package and a checkpoint are installed.
    checkpoint : File with the weights of beat_this.
    """
    from harmolab.beats.audio import with_clicks
    from harmolab.beats.meter import describe_beats
    from harmolab.beats.tempo import octave_remark
    from harmolab.readers.audio import load_sound, save_audio
    from harmolab.readers.beats import save_beats

    with plain_errors():
        common.check_out(out, "a file of beats", (".beats",))
        common.check_out(clicks, "the song with clicks", (".wav",))
        audio = load_sound(song)
        track = _beats(audio, dance, one, beats, tracker, checkpoint)
        text = describe_beats(track)
        if out is not None:
            save_beats(out, track, comment=f"{song.name}: {text}")
        if clicks is not None:
            save_audio(clicks, with_clicks(audio, track))
    typer.echo(text)
    if not dance and track.quality is not None and len(track) > 1:
        typer.echo(octave_remark(track.tempo))
    wrote(out)
    wrote(clicks)


def _beats(
    audio: Audio, dance: str, one: float | None, beats: Path | None, tracker: Tracker, checkpoint: Path | None
) -> BeatTrack:
    """The beats of a song from a file or a tracker."""
    from harmolab.clips import song_beats
    from harmolab.readers.beats import neural_beats

    if tracker == "beat_this":
        if beats is not None or one is not None:
            raise ValueError("--tracker beat_this finds the beats and the bars itself; leave out --beats and --one")
        return neural_beats(audio, checkpoint)
    with finding_beats():
        return song_beats(audio, dance=dance, beats=beats, one=one)


def tap(
    song: Song,
    out: Annotated[Path, typer.Option()],
    meter: Annotated[int, typer.Option(min=1, max=32)] = 4,
    port: Annotated[int, typer.Option(min=0, max=65535)] = 0,
    no_open: Annotated[bool, typer.Option("--no-open")] = False,
) -> None:
    """Tap the beats of a song, and mark "one", on a page that only this machine can open.

    Ten seconds of taps are enough for a song of one tempo: the beats go on to both ends of it. Other commands take the
    file with --beats.

    Example: `harmolab tap song.mp3 --meter 3 --out song.beats`

    Parameters
    ----------
    out : Where the beats are written, .beats.
    meter : Beats in a bar: 3 for a waltz.
    port : Port of the local page; 0: any free one.
    no_open : Print the address only.
    """
    from harmolab.beats.meter import describe_beats
    from harmolab.readers.audio import load_sound
    from harmolab.readers.beats import save_beats, tapped_beats

    def save(taps: FloatArray, ones: FloatArray) -> str:
        result = tapped_beats(audio, taps, ones, meter=meter)
        save_beats(out, result.track, comment=f"{song.name}, tapped: {describe_beats(result.track)}")
        lines.append(" ".join([f"wrote {out}: {describe_beats(result.track)}.", result.remark]).strip())
        return lines[-1]

    lines: list[str] = []
    with plain_errors():
        common.check_out(out, "a file of beats", (".beats",))
        common.check_pages("harmolab tap")
        from harmolab.lab.listening.local_page import TapServer

        audio = load_sound(song)
        common.serve(TapServer(song.name, audio, save, port=port), no_open, "nothing is written until you save")
    typer.echo("\n".join(lines) or "nothing was saved")
