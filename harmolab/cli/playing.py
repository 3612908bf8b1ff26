"""`harmolab play`: a motion and its music as one page that plays anywhere."""

import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from harmolab.cli import common
from harmolab.cli.posing import is_body_found
from harmolab.cli.screen import note, plain_errors, waiting, wrote
from harmolab.cli.sources import check_signs, clip_of, note_lengths, sources

VIDEO = (
    "{video}: is a video, of which no body is known to play; `harmolab pose --install` fetches what finds it. Without, "
    "`harmolab explain {video} --out {stem}.html` makes a page about it, `harmolab render {video} --out "
    "{stem}_marked.mp4` marks its beats"
)


@common.with_options
def play(
    context: typer.Context,
    song: common.Song,
    out: Annotated[Path, typer.Option()],
    motion: common.Dance = None,
    other: Path | None = None,
    offset: common.Offset = None,
    other_offset: float | None = None,
    start: common.Start = None,
    seconds: common.Seconds = None,
    *,
    judged: common.JudgeOptions,
    read: common.FileOptions,
) -> None:
    """Write a page that plays a motion to its music: beats, hits and misses on a time line, slow motion, loops, clicks.

    Below the picture stand the verdict and the number of what is shown, the same as those of `harmolab score`. The
    marks are rests of the body, or hits where it hits the beats, within a tenth of a second of the music.

    Example: `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`

    Example: `harmolab play recordings/DANCE_W_3 --out dance.html`

    Parameters
    ----------
    out : The page to write, .html.
    other : A second motion to the same music, shown beside it.
    other_offset : Audio time at which the second begins (default: what its file says, else --offset).
    """
    from harmolab.data.recordings import load_any_motion, recorded_offset
    from harmolab.lab.player import player_of
    from harmolab.verdict.judge import score_clip

    with plain_errors():
        common.check_out(out, "the player", common.PAGES)
        files = sources(context, song, motion, judged)
        if files.is_video and not is_body_found(files.motion):
            raise ValueError(VIDEO.format(video=files.motion, stem=files.motion.stem))
        params = judged.params(files.dance)
        clip = clip_of(files, offset=offset, sample_rate=None, **read.keywords)
        note_lengths(clip, files.song)
        if files.is_video:
            begin = clip.offset if start is None else start
            part = clip.span(begin, clip.audio.duration - begin if seconds is None else seconds)
            check_signs(files, part, [score_clip(part, params)])
        clips = [clip]
        if other is not None:
            begins = next((time for time in (other_offset, recorded_offset(other)) if time is not None), clip.offset)
            movement = load_any_motion(other, report=common.note_assumptions, **read.keywords)
            clips.append(replace(clip, name=other.stem or other.name, motion=movement, offset=begins))
        where = {"offset": clip.offset, "start": start, "seconds": seconds}
        command = common.video_command(files.song, files.motion, out, files.dance, **where)
        title = common.dance_title(files.motion, files.song)
        player_of(clips, start=start, seconds=seconds, title=title, params=params, command=command).save(out)
    wrote(out)


# `harmolab demo`: a first page to look at, without any file.

NEXT = (
    "What next?",
    "  harmolab dance SONG.mp3                      a dance to a song of yours",
    "  harmolab explain VIDEO.mp4 --out page.html   your own dance: are you in time?",
)


def demo(out: Path = Path("harmolab_demo.html"), no_open: Annotated[bool, typer.Option("--no-open")] = False) -> None:
    """See what harmolab does: a page with a dancer who meets the beats, and the same one late. Needs no files.

    The song is synthetic; the movement was recorded (CMU, salsa) and comes with harmolab.

    Example: `harmolab demo`

    Parameters
    ----------
    out : The page to write, .html.
    no_open : Write the page, and do not open it.
    """
    with plain_errors():
        common.check_out(out, "the page", common.PAGES)
        with waiting("making the page"):
            from harmolab.lab import player as pages

            page = pages.demo()
            page.player.save(out)
    typer.echo("A page with two dancers, who are one: recorded salsa, laid on the beats of a synthetic song.")
    for name, score in (("left, in time", page.in_time), (f"right, {page.late:.2f} s late", page.delayed)):
        met = f"{int((score.pairs >= 0).sum())} of {score.n_audio} beats met"
        verdict = "" if score.judgement is None else score.judgement.verdict
        typer.echo(f"  {name}: {met}, harmony above chance {score.above_chance:.2f}. {verdict}")
    typer.echo("Press play on the page; the lamps flash on the beats of the music and of the dancer.")
    wrote(out)
    typer.echo("\n".join(NEXT))
    if not no_open and not webbrowser.open(out.resolve().as_uri()):
        note(f"no browser could be opened; open {out.resolve()} in one")
