"""`harmolab play`: a motion and its music as a page or a video that plays anywhere; and `harmolab demo`."""

from __future__ import annotations

import webbrowser
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from harmolab.cli import common
from harmolab.cli.posing import is_body_found
from harmolab.cli.rendering import GIF, VideoOptions, render
from harmolab.cli.screen import note, plain_errors, waiting, wrote
from harmolab.cli.sources import Sources, check_signs, clip_of, sources

if TYPE_CHECKING:
    from harmolab.params import HarmonyParams

VIDEO = (
    "{video}: is a video, of which no body is known to play; `harmolab data pose --install` fetches what finds it. "
    "Without, `harmolab score {video} --why {stem}.html` makes a page about it, `harmolab play {video} --out "
    "{stem}_marked.mp4` marks its beats"
)
OF_PAGES, OF_VIDEOS = ("other", "other_offset"), ("over", "marks", "verdict", "follow", "height", "rate")


@common.with_options
def play(
    context: typer.Context,
    song: common.Song,
    out: Annotated[Path, typer.Option()],
    motion: common.Dance = None,
    *,
    part: common.PartOptions,
    other: Path | None = None,
    other_offset: float | None = None,
    video: VideoOptions,
    judged: common.JudgeOptions,
    read: common.FileOptions,
) -> None:
    """Show a motion with its music: a page with beats, slow motion and loops, a video, or a moving picture.

    The ending of --out says which: .html is a page that plays anywhere; .mp4 and .webm are videos of a person on a
    floor, or of a skeleton over the dancer's own film; .gif is for a README, without sound, 5 s unless --seconds says
    otherwise. The verdict and the number are those of `harmolab score`, on the whole dance also where --seconds shows a
    part: for a clip to share, `--seconds 6`. The marks are rests of the body, or hits where it hits the beats, within a
    tenth of a second of the music. A film alone gets the marks, and a skeleton where `harmolab data pose` finds the
    body.

    Examples:

    `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`

    `harmolab play recordings/DANCE_W_3 --start 20 --out dance.gif`

    `harmolab play phone_video.mp4 --out marked.mp4`

    `harmolab play take.mp4 keypoints/ --fps 25 --over take.mp4 --out checked.webm`

    Parameters
    ----------
    out : What to write: .html, .mp4 (plays everywhere), .webm or .gif.
    other : Page: a second motion to the same music, shown beside it.
    other_offset : Page: audio time at which the second begins (default: what its file says, else --offset).
    """
    is_page = out.suffix.lower() in common.PAGES
    with plain_errors():
        common.check_out(out, "a dance with its music", (*common.PAGES, *common.VIDEOS_OUT, GIF))
        if wrong := common.first_told(context, OF_VIDEOS if is_page else OF_PAGES):
            raise ValueError(f"{wrong} is for {'a video' if is_page else 'a page'}, not for {out}")
        files = sources(context, song, motion, judged)
        params = judged.params(files.dance)
        if is_page:
            _page(files, out, params, read, part, other=other, other_offset=other_offset)
        else:
            render(files, out, video, params, read, part)
    wrote(out)


def _page(
    files: Sources,
    out: Path,
    params: HarmonyParams,
    read: common.FileOptions,
    part: common.PartOptions,
    *,
    other: Path | None,
    other_offset: float | None,
) -> None:
    """Write the page with the player."""
    from harmolab.data.recordings import load_any_motion, recorded_offset
    from harmolab.lab.player import player_of
    from harmolab.verdict.judge import score_clip

    if files.is_video and not is_body_found(files.motion):
        raise ValueError(VIDEO.format(video=files.motion, stem=files.motion.stem))
    clip = clip_of(files, offset=part.offset, sample_rate=None, **read.keywords)
    if files.is_video:
        begin = clip.offset if part.start is None else part.start
        excerpt = clip.span(begin, clip.audio.duration - begin if part.seconds is None else part.seconds)
        check_signs(files, excerpt, [score_clip(excerpt, params)])
    clips = [clip]
    if other is not None:
        begins = next((time for time in (other_offset, recorded_offset(other)) if time is not None), clip.offset)
        movement = load_any_motion(other, report=common.note_assumptions, **read.keywords)
        clips.append(replace(clip, name=other.stem or other.name, motion=movement, offset=begins))
    where = vars(part) | {"offset": clip.offset}
    command = common.video_command(files.song, files.motion, out, files.dance, **where)
    title = common.dance_title(files.motion, files.song)
    player_of(clips, start=part.start, seconds=part.seconds, title=title, params=params, command=command).save(out)


# `harmolab demo`: a first page to look at, without any file.

NEXT = (
    "What next?",
    "  harmolab dance SONG.mp3                      a dance to a song of yours",
    "  harmolab score VIDEO.mp4 --why page.html     your own dance: are you in time?",
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
    if not no_open:
        open_page(out)


def open_page(page: Path) -> None:
    """Open a page in the browser, or say that there is none."""
    if not webbrowser.open(page.resolve().as_uri()):
        note(f"no browser could be opened; open {page.resolve()} in one")
