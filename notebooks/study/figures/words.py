"""Corpora and findings in words, for titles of figures."""

from collections.abc import Mapping, Sequence

from harmolab.types import Clip

CORPUS_WORDS: Mapping[str, str] = {
    "beatlocked": "recordings on the beat",
    "aist": "street dance, clicks for songs",
    "synthetic": "synthetic dancers",
    "realdance/dance": "choreographed dances",
    "realdance/replays": "players of a rhythm game",
    "realdance/robots_not_in_tempo": "robots out of tempo",
    "tang2018": "Tang et al., as shipped",
    "tang2018_rebuilt": "Tang et al., re-timed",
}


def corpus_words(corpus: str) -> str:
    """A corpus as a reader would call it; its own name if nothing better is in `CORPUS_WORDS`.

    >>> corpus_words("beatlocked")
    'recordings on the beat'
    """
    return CORPUS_WORDS.get(corpus, corpus)


def is_synthetic(corpus: str) -> bool:
    """True if a corpus, or a source in the manifest, has synthetic data in it."""
    return "synthetic" in corpus.lower()


def clip_words(clip: Clip) -> str:
    """Dance, name and corpus of a clip, for a title.

    >>> from harmolab.types import Audio
    >>> clip_words(Clip("DANCE_C_1", Audio([0.0, 0.0], 2.0), dance="cha-cha", source="beatlocked"))
    'Cha-cha DANCE_C_1, recordings on the beat'
    """
    name = clip.name if clip.name.startswith(clip.dance) else f"{clip.dance} {clip.name}"
    return f"{sentence(name)}, {corpus_words(clip.source)}"


def count_words(count: int, total: int) -> str:
    """A count beside its total, with words for both ends.

    >>> count_words(7, 7), count_words(0, 7), count_words(3, 7)
    ('all 7', 'none of 7', '3 of 7')
    """
    if count == total:
        return f"all {total}"
    return f"{count or 'none'} of {total}"


def sentence(text: str) -> str:
    """`text` with a capital letter; other letters stay as they are."""
    return text[:1].upper() + text[1:]


def listed(words: Sequence[str]) -> str:
    """Words with commas and "and".

    >>> listed(["one", "two", "three"])
    'one, two and three'
    """
    return " and ".join([part for part in (", ".join(words[:-1]), *words[-1:]) if part])
