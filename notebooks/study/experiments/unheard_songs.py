"""Songs that no training heard, and what is danced to them: how long, how often, beside which recorded dancers."""

from dataclasses import replace
from functools import cache, lru_cache

import numpy as np
from scipy.ndimage import gaussian_filter1d

from harmolab.params import DANCES
from harmolab.systems.music2dance.codes import body_points
from harmolab.types import Clip, Motion
from study.experiments.contests import Contest, Excerpt, recorded_songs, synthetic_songs
from study.experiments.generation import SYNTHETIC, generator_corpora
from study.experiments.study import planted_song
from study.profile import RunProfile

QUICK_SECONDS, QUICK_DRAWS, QUICK_DANCES = 10.0, 2, ("cha-cha", "waltz")
LEVELS = (0.0, -6.0, -12.0, -18.0)  # decibels of the parts of a song with form, each twice
STOP_SECONDS, FADE = 4.0, 0.05  # of its silence; standard deviation, seconds, of a change of loudness
UNHEARD = 900_000  # first seed of their songs; those of corpora are drawn from another sequence


@lru_cache(maxsize=64)  # a minute each: all that a quick run asks for, again and again
def unheard_song(dance: str, number: int, seconds: float) -> Excerpt:
    """A synthetic song of a dance that is in no corpus, with its planted beats and "one": all of it is danced."""
    clip = replace(planted_song(dance, number, seconds, UNHEARD), name=f"{dance} {number}", motion=None)
    return Excerpt(clip.name, clip, 0.0, seconds)


def songs_with_form(profile: RunProfile, seconds: float) -> list[Excerpt]:
    """`song_with_form` of two songs of each dance; of one of two dances in a quick profile."""
    dances, count = (QUICK_DANCES, 1) if profile.epochs else (tuple(DANCES), 2)
    return [song_with_form(dance, number, seconds) for dance in dances for number in range(count)]


def song_with_form(dance: str, number: int, seconds: float) -> Excerpt:
    """An `unheard_song` that has loud and quiet parts, in an order of its own, and a silence between two of them."""
    song = unheard_song(dance, number, seconds)
    audio, rng = song.clip.audio, np.random.default_rng([UNHEARD, list(DANCES).index(dance), number])
    levels = np.concatenate([rng.permutation(LEVELS), rng.permutation(LEVELS)])
    times, part = np.arange(0.0, seconds, FADE / 5), seconds / levels.size
    gains = 10 ** (levels[(times / part).astype(int)] / 20)
    stop = part * rng.integers(3, 6)
    gains[(stop <= times) & (times < stop + STOP_SECONDS)] = 0.0
    gain = np.interp(np.arange(audio.samples.size) / audio.sample_rate, times, gaussian_filter1d(gains, 5.0))
    shaped = replace(audio, samples=(audio.samples * gain).astype(audio.samples.dtype))
    return replace(song, song=f"{song.song} with form", clip=replace(song.clip, audio=shaped))


def common_points(motion: Motion) -> Motion:
    """The twenty points that Music2Dance's rotations are fitted to; a body that lacks one of them as it is."""
    try:
        return body_points(motion)
    except ValueError:
        return motion


def dance_seconds(profile: RunProfile, seconds: float) -> float:
    """So many seconds, ten in a quick profile."""
    return QUICK_SECONDS if profile.epochs else seconds


def n_draws(profile: RunProfile, count: int) -> int:
    """So many dances of each style, two in a quick profile."""
    return QUICK_DRAWS if profile.epochs else count


@cache
def unheard(profile: RunProfile, corpus: str | None = None, *, trainings: int | None = None) -> Contest:
    """A contest of songs that no training heard, with all dancers of a corpus (of two dances in a quick profile).

    Parameters
    ----------
    profile : RunProfile
    corpus : str, one of `generation.generator_corpora`, the first when left out
    trainings : int, of each network; the profile's when left out
    """
    corpus = corpus or generator_corpora(profile)[0]
    dancers = synthetic_songs(profile) if corpus == SYNTHETIC else recorded_songs(profile)
    if profile.epochs:
        dancers = [excerpt for excerpt in dancers if excerpt.clip.dance in QUICK_DANCES]
    trainings = profile.n_seeds if trainings is None else trainings
    return Contest(profile, corpus, "songs that no training heard", (), tuple(dancers), trainings)


def recorded_dancers(contest: Contest) -> dict[str, list[Clip]]:
    """Dance -> whole recordings of it in the contest's corpus, each once."""
    clips: dict[str, Clip] = {excerpt.song: excerpt.clip for excerpt in contest.dancers}
    by_dance: dict[str, list[Clip]] = {}
    for clip in clips.values():
        by_dance.setdefault(clip.dance, []).append(clip)
    return by_dance
