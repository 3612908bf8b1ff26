"""From a song and a dance to a video: drawn on a floor, or laid over the dancer's own video."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import skull_and_limbs
from harmolab.clips import load_clip
from harmolab.data.recordings import ReadingReport, load_any_motion
from harmolab.files import MAX_JSON_BYTES, Counted, PathLike, Progress, check_output, reading, silent
from harmolab.lab.explain.filmed import check_sign, filmed_motion, has_body
from harmolab.lab.render import stick
from harmolab.lab.render.scene import render_dance
from harmolab.lab.render.stick import FRACTION_BITS, BeatMarks, Frame, Stroke
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.readers.keypoints import content_points, described_motion, json_or_lines
from harmolab.readers.motion import save_motion
from harmolab.readers.motion_file import ReadingKeywords
from harmolab.readers.player_points import joint_widths, limb_widths
from harmolab.readers.video import CODINGS, VideoFrames, is_video, video_frames, write_gif, write_video
from harmolab.retime.retime import Retimed, retime, warp_video
from harmolab.retime.warps import Method
from harmolab.score import HarmonyScore
from harmolab.types import Audio, Clip, Motion
from harmolab.verdict.judge import score_clip, score_motion

# A dancer's skeleton over the video that it comes from

CORE, RIM = (255, 255, 255), (20, 20, 20)  # a light line in a dark one is seen on any picture
THICKNESS = 1 / 110  # of a limb, in picture heights
SHARES_UP_TO = 2.0  # points whose median is below are shares of the picture: no body fits into two pixels
LEAST_INSIDE = 0.5  # share of the points that must lie in the picture
IN_SPACE = "is movement in space; over a video go points of its pictures (OpenPose, COCO, MediaPipe)"


def load_points(
    path: PathLike,
    *,
    fps: float | None = None,
    joints: tuple[str, ...] | None = None,
    report: ReadingReport = lambda path, file: None,
) -> Motion:
    """A dancer's points in a picture, from a file of key points or landmarks.

    Parameters
    ----------
    path : str or path
        COCO-17, OpenPose or MediaPipe, or our own `.npz`, as `load_any_motion` reads them.
    fps : float, frames per second, where the file holds no rate
    joints : names to keep, optional
    report : function(path, MotionFile), called with how the file was read

    Returns
    -------
    Motion with (T, J, 2) positions, as the file has them: pixels, or shares of the picture

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; a motion in space is an error.
    """
    motion = load_any_motion(path, fps=fps, joints=joints, report=report)
    if motion.positions.shape[2] != 2:
        raise ValueError(f"{path}: {IN_SPACE}")
    if Path(path).suffix.lower() == ".json":
        with reading(path, "key points", max_bytes=MAX_JSON_BYTES) as file:
            places, about = content_points(json_or_lines(file))
            # MediaPipe's as shares of both sides, whatever proportions of the picture the file notes.
            passed = {"aspect": 1.0} | ({} if fps is None else {"fps": fps})
            return described_motion(places, about | passed, joints=joints)
    return motion


def since_file_begins(points: Motion, late: float) -> Motion:
    """Points of a film whose first picture comes `late` seconds after its start, with filler before their first frame.

    Programs that find points begin with the first picture; `video_frames` holds it from the start of the file on.
    """
    before = round(late * points.fps)
    positions = np.concatenate([np.repeat(points.positions[:1], before, axis=0), points.positions])
    return Motion(positions, points.fps, points.skeleton, np.concatenate([np.zeros(before, bool), points.valid]))


def points_in_picture(motion: Motion, video: VideoFrames) -> Motion:
    """The points in pixels of the frames that `video` gives.

    Points between 0 and 1 (MediaPipe) are taken as shares of the picture's width and height, others as pixels of the
    video's own pictures.

    Raises
    ------
    ValueError
        For a motion in space, and where most points lie outside the picture: they are of another one.
    """
    if motion.positions.shape[2] != 2:
        raise ValueError(f"the motion {IN_SPACE}")
    height, width = video.source_size
    points = motion.positions[motion.valid]
    are_shares = points.size and np.median(np.abs(points)) <= SHARES_UP_TO
    unit = np.array([1.0, 1.0] if are_shares else [width, height])
    inside = float(((points >= 0) & (points <= unit)).all(axis=-1).mean()) if points.size else 1.0
    if inside < LEAST_INSIDE:
        raise ValueError(
            f"{video.path}: {1 - inside:.0%} of the points lie outside its pictures of {width} x {height} pixels; "
            "are they of this video, at this size?"
        )
    places = motion.positions * (np.array([video.width, video.height]) / unit)
    return Motion(places, motion.fps, motion.skeleton, motion.valid)


def overlay_skeleton(
    frames: Iterable[Frame], fps: float, motion: Motion, *, score: HarmonyScore | None = None, begin: float = 0.0
) -> Iterator[Frame]:
    """The frames with the skeleton over them, as long as both last; the motion's first frame lies on the first frame.

    Parameters
    ----------
    frames : iterable of (H, W, 3) uint8 RGB arrays; they are not changed
    fps : float, hertz, of the frames
        A motion of another rate is interpolated.
    motion : Motion
        (T, J, 2) pixels of the frames, as from `points_in_picture`. Frames that are not valid are left undrawn.
    score, begin : as in `harmolab.lab.render.scene.render_dance`

    Yields
    ------
    (H, W, 3) uint8 arrays, frame i at i / fps seconds
    """
    if motion.positions.shape[2] != 2:
        raise ValueError(f"the motion {IN_SPACE}")
    stick.check_positive(fps=fps)
    motion = resample_motion(motion, fps)
    _, limbs = skull_and_limbs(motion.skeleton)
    widths = [*limb_widths(motion.skeleton, limbs), *joint_widths(motion.skeleton)]
    marks: BeatMarks | None = None
    # The motion first: zip would else read one frame too many.
    for index, (places, is_valid, frame) in enumerate(zip(motion.positions, motion.valid, frames, strict=False)):
        marks = marks or BeatMarks(len(frame), score, begin=begin)
        drawn = frame.copy()
        if is_valid:
            stick.draw_strokes(drawn, _strokes(stick.fixed(places).tolist(), limbs, widths, len(frame)))
        marks.draw(drawn, index, fps)
        yield drawn


def _strokes(
    points: list[list[int]], limbs: list[tuple[int, int]], widths: list[float], height: int
) -> Iterator[Stroke]:
    """Limbs and joints twice: thick and dark, then thinner and light; `widths` of limbs, then of joints."""
    thickness = max(2, round(THICKNESS * height))
    for colour, extra in ((RIM, thickness + 2), (CORE, 0)):
        for (start, end), width in zip(limbs, widths, strict=False):
            yield Stroke(points[start], points[end], max(1, round(width * (thickness + extra))), colour)
        for point, width in zip(points, widths[len(limbs) :], strict=True):
            radius = width * (0.3 * thickness + (thickness + extra) / 2) * 2**FRACTION_BITS
            yield Stroke(point, None, round(radius), colour)


RATE = 30.0  # pictures a second where nothing else is asked for


def write_dance(
    out: PathLike,
    clip: Clip,
    *,
    over: PathLike | None = None,
    points: Motion | None = None,
    marks: bool = True,
    rate: float | None = None,
    height: int = 480,
    follow: bool = False,
    score: HarmonyScore | None = None,
    begin: float = 0.0,
    verdict: str = "",
    params: HarmonyParams | None = None,
    progress: Progress = silent,
) -> None:
    """Write a dance with its music as a video: a drawn person on a floor, or lines over the dancer's own film.

    Parameters
    ----------
    out : str or path
        Ends in .mp4, .webm or .gif, which has no sound.
    clip : Clip with a motion
        The video shows the whole motion, with the part of the sound that belongs to it.
    over : str or path, optional
        The film in which the points of the motion were found; they are drawn over it. Where the motion is that of a
        whole picture, marks of beats alone are drawn.
    points : Motion, (T, J, 2), optional
        The points in that film, where the motion of the clip is in space.
    marks : bool
        Whether marks light up on beats of the music, on those of the dancer, and where they meet.
    rate : float, pictures a second
        30 when left out; a film keeps its own.
    height : int, pixels
    follow : bool
        Whether the camera follows, so that the hips stay in the middle of the picture.
    score : HarmonyScore, optional
        Of the motion with its music; the marks show its beats and hits. That by `params` when left out.
    begin : float, seconds
        Place of the first frame on the score's time line, where the clip is a part of what was scored.
    verdict : str
        Words at the lower edge of the picture.
    params : HarmonyParams
        When left out the recommended ones, with the usual course of the clip's dance where it is known.
    progress : function(iterable, label) -> iterable
        Reports on the pictures, such as a progress bar.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError for `rate` or `follow` over a film, too.

    Examples
    --------
    >>> write_dance("dance.mp4", clip)  # doctest: +SKIP
    """
    motion = _motion(clip)
    if over is None:
        rate = RATE if rate is None else rate
        drawn_score = (score or _score(clip, motion, params)) if marks else None
        frames = render_dance(motion, fps=rate, height=height, score=drawn_score, begin=begin, follow=follow)
    elif rate is not None or follow:
        raise ValueError(f"{over}: is drawn as it was filmed, at its own frame rate; leave out --rate and --follow")
    else:
        check_output(out, [over])
        video = video_frames(over, height=height, colour=True)
        drawn, rate = _over(motion if points is None else points.span(0.0, motion.duration), video), video.fps
        judged = drawn if points is None and has_body(motion) else motion  # of the flow no frame is drawn, all count
        drawn_score = (score or _score(clip, judged, params)) if marks else None
        frames = overlay_skeleton(video, rate, drawn, score=drawn_score, begin=begin)
    frames = stick.captioned(frames, verdict) if verdict else frames
    pictures = progress(Counted(frames, round(motion.duration * rate)), "drawing")
    if Path(out).suffix.lower() == ".gif":
        write_gif(out, pictures, rate)
    else:
        write_video(out, pictures, rate, audio=sound_of(clip))


def retime_files(
    song: PathLike,
    motion: PathLike,
    out: PathLike,
    *,
    offset: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    one: float | None = None,
    params: HarmonyParams | None = None,
    strength: float = 1.0,
    phase: float = 0.0,
    slowest: float = 0.7,
    fastest: float = 1.4,
    method: Method = "dp",
    height: int = 480,
    progress: Progress = silent,
    **reading: Unpack[ReadingKeywords],
) -> Retimed:
    """Write a motion, or a video, whose time is bent until its beats meet those of the song; the `Retimed` motion.

    Parameters
    ----------
    song, motion, offset, dance, beats, one : as in `load_clip`; `motion` may also be a video
        A video moves as its dancer does (`harmolab.lab.explain.filmed.filmed_motion`). Where `offset` is left out it
        begins with the song, and beside another file's song no place in the beat is judged;
        `harmolab.lab.explain.offset.find_sound_offset` finds where else it begins, by the sound.
    out : str or path that ends in .npz, .bvh, .mp4 or .webm; of a video .mp4 or .webm
    params : HarmonyParams of the number before and after, as in `harmolab.verdict.judge.score_clip`
    strength, phase, slowest, fastest, method : as in `harmolab.retime.retime`
    height : int, pixels, of a video; a film is never enlarged
    progress : Progress over reading, beat tracking and drawing
    reading : fps, scale, joints, smpl, up, as in `load_clip`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError also for a setting out of range, and where a video was read too poorly and
        shows no sign of the beat, bent or not: then nothing is written.
    """
    check_output(out, [song, motion])
    video = Path(motion) if is_video(motion) else None
    movement = filmed_motion(video, progress=progress).motion if video else motion
    for path in progress([song], "finding the beats"):
        clip = load_clip(path, movement, offset=offset, dance=dance, beats=beats, one=one, sample_rate=None, **reading)
    if video and offset is None:
        clip = replace(clip, has_start=video.samefile(song))
    moves = _motion(clip)
    music = music_beats(clip).span(clip.offset, moves.duration)
    retimed = retime(
        moves, music, phase=phase, strength=strength, slowest=slowest, fastest=fastest, method=method,
        score=lambda bent: score_clip(replace(clip, motion=bent), params),
    )  # fmt: skip
    if max(score.judgement.level if score.judgement else 0 for score in (retimed.before, retimed.after)) == 1:
        check_sign(motion, moves)  # what was bent is not the dancer
    if video:
        warp_video(video, out, retimed.warp, sound_of(clip), height=height, progress=progress)
    elif Path(out).suffix.lower() in CODINGS:
        write_dance(out, replace(clip, motion=retimed.motion), height=height, params=params, progress=progress)
    else:
        save_motion(out, retimed.motion, offset=clip.offset)
    return retimed


def sound_of(clip: Clip) -> Audio:
    """The sound from the motion's first frame to its last; silence where there is none yet."""
    silence = max(0.0, -clip.offset)
    sound = clip.audio.span(max(0.0, clip.offset), _motion(clip).duration - silence)
    return Audio(np.pad(sound.samples, (round(silence * sound.sample_rate), 0)), sound.sample_rate)


def _over(motion: Motion, video: VideoFrames) -> Motion:
    """The points to be drawn over a video; none are seen of the movement of the whole picture, which has no points."""
    if not has_body(motion):
        return replace(motion, valid=np.zeros(motion.n_frames, bool))
    return points_in_picture(motion, video)


def _motion(clip: Clip) -> Motion:
    if not isinstance(clip, Clip):
        raise ValueError(f"a harmolab.Clip is needed, got {type(clip).__name__}")
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to show")
    return clip.motion


def _score(clip: Clip, motion: Motion, params: HarmonyParams | None) -> HarmonyScore | None:
    """The score whose rests or hits the marks of a video show; None where the clip has no beats."""
    if clip.beats is None:
        return None
    params = params or HarmonyParams.recommended(DANCE_PATTERNS.get(clip.dance))
    return score_motion(clip.beats.span(clip.offset, motion.duration), motion, params=params)
