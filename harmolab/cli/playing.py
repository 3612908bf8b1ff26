"""`harmolab play`: a motion and its music as a page or a video that plays anywhere; and `harmolab demo`."""

from __future__ import annotations

import webbrowser
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

import harmolab
from harmolab.cli import common
from harmolab.cli.common import HEIGHT, FileOptions, JudgeOptions, PartOptions
from harmolab.cli.data import is_body_found
from harmolab.cli.screen import note, progress, waiting, wrote
from harmolab.cli.sources import Sources, check_signs, clip_of, film_offset, reading_fault, sources

if TYPE_CHECKING:
    from harmolab.verdict.judge import Judgement

# Videos and moving pictures of a motion and its music

GIF = ".gif"
GIF_SECONDS, GIF_HEIGHT, GIF_RATE = 5.0, 240, 12.5  # unless asked for otherwise: some hundred kilobytes
NO_GIF = "a video has more colours than a gif; choose a name that ends in .mp4 or .webm"
NO_START = "a video is drawn from its first picture on; leave out --start"


@dataclass(frozen=True)
class VideoOptions:
    """Options of a video.

    Parameters
    ----------
    over : Video: draw the skeleton over this film, in which the points were found.
    marks : Video: marks that light up on beats: of the music, of the dancer, met (green), missed (red).
    verdict : Video: the verdict on the whole dance, below in the picture.
    follow : Video: keep the hips in the middle of the picture.
    height : Video: height in pixels; the width is 4/3 of it. A film keeps its shape, and is never enlarged.
    rate : Video: pictures a second (default: those of the film, else 30, or 12.5 in a gif, which has 50 at most).
    """

    over: Path | None = None
    marks: bool = True
    verdict: bool = True
    follow: Annotated[bool, typer.Option("--follow")] = False
    height: Annotated[int | None, typer.Option(min=120, max=2160, show_default="480; 240 of a gif")] = None
    rate: Annotated[float | None, typer.Option(min=10, max=120)] = None


@dataclass(frozen=True)
class PageOptions:
    """Options of a page.

    Parameters
    ----------
    other : Page: a second motion to the same music, shown beside it.
    other_offset : Page: audio time at which the second begins (default: what its file says, else --offset).
    """

    other: Path | None = None
    other_offset: float | None = None


def render(
    files: Sources, out: Path, video: VideoOptions, params: harmolab.HarmonyParams, read: FileOptions, part: PartOptions
) -> None:
    """Write the video, and print the verdict on the whole dance, of which it may show a part."""
    from harmolab.lab.explain.filmed import points_in_video
    from harmolab.lab.player_data import of_dance
    from harmolab.lab.render.video import load_points, since_file_begins, write_dance
    from harmolab.readers.video import first_picture

    is_gif, over = out.suffix.lower() == GIF, video.over or (files.motion if files.is_video else None)
    if over is not None and (is_gif or part.start is not None):
        raise ValueError(f"{over}: {NO_GIF if is_gif else NO_START}")
    seconds = GIF_SECONDS if is_gif and part.seconds is None else part.seconds
    if seconds is not None and seconds <= 0:
        raise ValueError(f"seconds must be positive and finite, got {seconds:g}")
    reading, points, offset = read.keywords, None, part.offset
    if over is not None and not files.is_video:
        points = load_points(files.motion, fps=read.fps, joints=reading["joints"], report=common.note_assumptions)
        points = since_file_begins(points, late := first_picture(over))
        offset = film_offset(files, over) if offset is None else offset - late
    clip = clip_of(files, offset=offset, track=video.marks, sample_rate=None, movement=points, **reading)
    if points is not None and offset is None:
        clip = replace(clip, has_start=False)
    in_video = points_in_video(files.motion) if files.is_video else None
    score = harmolab.score_clip(clip, params) if video.marks else None
    judgement = _judgement(files, clip, score)
    excerpt, begin = _part(clip, part.start, seconds)
    write_dance(
        out, excerpt, over=over, points=in_video, marks=video.marks, rate=video.rate or (GIF_RATE if is_gif else None),
        height=video.height or (GIF_HEIGHT if is_gif else HEIGHT), follow=video.follow, score=score, begin=begin,
        verdict=of_dance(judgement.verdict) if judgement and video.verdict else "", progress=progress,
    )  # fmt: skip
    common.print_verdict(judgement)
    if score is not None:
        common.print_music(score.music)


def _judgement(files: Sources, clip: harmolab.Clip, score: harmolab.HarmonyScore | None) -> Judgement | None:
    """The judgement of a score; none, and a note, where a video was read too poorly for one."""
    if score is None or clip.motion is None:
        return None
    if fault := reading_fault(score, files.motion, clip.motion):  # the video is written all the same
        note(fault)
        return None
    return score.judgement


def _part(clip: harmolab.Clip, start: float | None, seconds: float | None) -> tuple[harmolab.Clip, float]:
    """The part of a clip that is drawn, and where its first frame lies on the time line of the whole clip's score."""
    motion = cast(harmolab.Motion, clip.motion)
    scored = max(clip.offset + clip.shared_frame() / motion.fps, 0.0)  # audio time at which the score begins
    if start is not None:
        if start >= clip.audio.duration:
            raise ValueError(f"{clip.name}: its music ends at {clip.audio.duration:.2f} s, before --start {start:g}")
        part = clip.span(start, seconds or clip.audio.duration - start)
        return part, start + part.offset - scored
    picture = motion if seconds is None else motion.span(0.0, seconds)
    return replace(clip, motion=picture), clip.offset - scored


VIDEO = (
    "{video}: is a video, and nothing here finds its body for the page; `harmolab data pose --install` fetches what "
    "does. Without that, `harmolab score {files} --why {stem}.html` makes a page about the video, and `harmolab play "
    "{files} --out {stem}_marked.mp4` marks its beats"
)


@common.with_options
def play(
    context: typer.Context,
    song: common.Song,
    out: Annotated[Path, typer.Option()],
    motion: common.Dance = None,
    *,
    part: PartOptions,
    page: PageOptions,
    video: VideoOptions,
    judged: JudgeOptions,
    read: FileOptions,
) -> None:
    """Show a motion with its music: a page with beats, slow motion and loops, a video, or a moving picture.

    The ending of --out says which. An .html file is a page that plays anywhere. An .mp4 or .webm file is a video of a
    person on a floor, or of a skeleton over the dancer's own film. A .gif file, for a README, has no sound, and is 5 s
    long unless --seconds says otherwise.

    The verdict and the number are those of `harmolab score`. They are of the whole dance, even where --seconds shows a
    part of it: `--seconds 6` makes a clip to share.

    A beat of the music is marked as met where the body rests within a tenth of a second of it, or hits, where the body
    hits the beats. A film without a file of its movement gets these marks, and also a skeleton where `harmolab data
    pose` finds the body.

    Examples:

    `harmolab play song.mp3 dance.bvh --offset 12.4 --seconds 30 --out dance.html`

    `harmolab play recordings/DANCE_W_3 --start 20 --out dance.gif`

    `harmolab play phone_video.mp4 --out marked.mp4`

    `harmolab play take.mp4 keypoints/ --fps 25 --over take.mp4 --out checked.webm`

    Parameters
    ----------
    out : What to write: .html, .mp4 (plays everywhere), .webm or .gif.
    """
    is_page = out.suffix.lower() in common.PAGES
    common.check_out(out, "a dance with its music", (*common.PAGES, *common.VIDEOS_OUT, GIF))
    common.check_untold(context, vars(video), f"is for a video, not for {out}", when=is_page)
    common.check_untold(context, vars(page), f"is for a page, not for {out}", when=not is_page)
    common.check_untold(context, ("other_offset",), "is of --other; name a second motion", when=page.other is None)
    judging = ("dance", "beats", "one", "pattern", "how", *(("verdict",) if video.verdict else ()))
    common.check_untold(context, judging, "is of no use with --no-marks; leave one of them out", when=not video.marks)
    files = sources(context, song, motion, judged)
    if is_page:
        _page(files, out, page, judged, read, part)
    else:
        render(files, out, video, judged.params(files.dance), read, part)
    wrote(out)


def _page(
    files: Sources, out: Path, page: PageOptions, judged: JudgeOptions, read: FileOptions, part: PartOptions
) -> None:
    """Write the page with the player."""
    from harmolab.data.recordings import load_any_motion, recorded_offset
    from harmolab.lab.player_data import player_of

    if files.is_video and not is_body_found(files.motion):
        paths = " ".join(dict.fromkeys(map(str, (files.song, files.motion))))
        raise ValueError(VIDEO.format(video=files.motion, files=paths, stem=files.motion.stem))
    params = judged.params(files.dance)
    clip = clip_of(files, offset=part.offset, sample_rate=None, **read.keywords)
    if files.is_video:
        check_signs(files, clip, [harmolab.score_clip(clip, params)])
    clips = [clip]
    if (other := page.other) is not None:
        recorded = recorded_offset(other)
        usual = clip.offset if recorded is None else recorded
        begins = usual if page.other_offset is None else page.other_offset
        movement = load_any_motion(other, report=common.note_assumptions, **read.keywords)
        clips.append(replace(clip, name=other.stem or other.name, motion=movement, offset=begins))
    where = vars(part) | {"offset": clip.offset if clip.has_start else None}
    if part.start is not None or other is not None:  # the page begins where all have
        where |= {"start": max(part.start or 0.0, *(one.offset for one in clips))}
    options = where | vars(judged) | {name: getattr(files, name) for name in ("dance", "beats", "one")} | vars(read)
    command = common.video_command(files.song, files.motion, out, **options)
    title = common.dance_title(files.motion, files.song)
    player_of(clips, start=part.start, seconds=part.seconds, title=title, params=params, command=command).save(out)


# `harmolab demo`: a first page to look at, without any file

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
    common.check_out(out, "the page", common.PAGES)
    with waiting("making the page"):
        from harmolab.lab import player_data

        page = player_data.demo()
        page.player.save(out)
    typer.echo("A page that shows one dancer twice: recorded salsa, laid on the beats of a synthetic song.")
    for name, score in (("left, in time", page.in_time), (f"right, {page.late:.2f} s late", page.delayed)):
        met = f"{int((score.pairs >= 0).sum())} of {score.n_audio} beats met"
        verdict = "" if score.judgement is None else player_data.of_dance(score.judgement.verdict)
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
