"""The request for a dance: music and options that all dancers take, checked; and the one door to them, `generate`.

No torch here: the choreographer dances without.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass

from harmolab.beats.audio import music_beats
from harmolab.body.skeletons import Skeleton
from harmolab.files import Progress, silent
from harmolab.params import DANCES, check_kinds
from harmolab.score import check_whole
from harmolab.types import Audio, BeatTrack, Clip, Motion, check_kind


@dataclass(frozen=True, eq=False)
class DanceRequest:
    """Music, and the options that all dancers of harmolab take.

    Parameters
    ----------
    audio : Audio
        The whole recording, even where only a part is danced to: beats are tracked in all of it.
    beats : BeatTrack on the audio time line; tracked when left out, with the tempo of `dance` as prior
    start : float, seconds of audio time
    seconds : float, length of the dance; to the end of the music when left out or longer
    seed : int
        Draws the movement that the dance starts from, and what the dancer leaves to chance.
    initial : Motion of the dancer's joints that the dance goes on from; then no other start is drawn
    dance : name of a dance
    plant_feet : bool
        Keep feet that carry from sliding (`harmolab.systems.training.feet`).
    progress : function(iterable, label) -> iterable
    """

    audio: Audio
    beats: BeatTrack | None = None
    start: float = 0.0
    seconds: float | None = None
    seed: int = 0
    initial: Motion | None = None
    dance: str | None = None
    plant_feet: bool = True
    progress: Progress = silent

    def __post_init__(self) -> None:
        check_kinds(self)
        check_whole(seed=self.seed)
        check_kind(self.audio, Audio, "audio")
        if self.initial is not None:
            check_kind(self.initial, Motion, "initial")

    def n_frames(self, fps: float) -> int:
        """Frames of the dance; ValueError if `start` or `seconds` lies outside the music, or there are not two."""
        start, seconds = self.start, math.inf if self.seconds is None else self.seconds
        if not 0 <= start < self.audio.duration:
            raise ValueError(f"start must lie within the music (0 to {self.audio.duration:.2f} s), got {start:g} s")
        if not seconds > 0:
            raise ValueError(f"seconds must be positive, got {seconds:g}")
        length = min(self.audio.duration - start, seconds)
        if (frames := int(length * fps + 1e-6)) < 2:
            raise ValueError(f"{length:.3f} s of music are less than two frames at {fps:g} per second")
        return frames

    def track(self) -> BeatTrack:
        """The beats of the music."""
        return music_beats(Clip("", self.audio, beats=self.beats, dance=self.dance or ""))

    def check_dance(self, names: Iterable[str]) -> None:
        """ValueError for a dance that is neither among these names nor in the tempo table."""
        dances = {*DANCES, *names} - {""}
        if self.dance and self.dance not in dances:
            raise ValueError(f"unknown dance {self.dance!r}; known: {', '.join(sorted(dances))}")


def check_initial(initial: Motion, skeleton: Skeleton, dancer: str) -> None:
    """ValueError where a motion to go on from is of other joints than a dancer (in words), or flat."""
    if (axes := initial.positions.shape[2]) != 3:
        raise ValueError(f"initial must be a motion in three dimensions, got {axes}")
    if initial.skeleton.joints != skeleton.joints:
        joints = len(initial.skeleton.joints), len(skeleton.joints)
        raise ValueError(f"initial has other joints ({joints[0]}) than {dancer} ({joints[1]}); retarget it first")


class DanceSystem:
    """A system whose `generate` is the one door of all dancers."""

    def respond(self, request: DanceRequest) -> Motion:
        """The dance that is asked for."""
        raise NotImplementedError

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str | None = None,
        plant_feet: bool = True,
        progress: Progress = silent,
    ) -> Motion:
        """A dance to music (`harmolab.systems.System`); all options are those of `DanceRequest`."""
        return self.respond(DanceRequest(audio, beats, start, seconds, seed, initial, dance, plant_feet, progress))
