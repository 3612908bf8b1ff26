"""Files that a reader picks in notebook 13."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from harmolab.lab.labs.one_clip import OwnFiles


def upload(files: OwnFiles, kind: str, name: str, content: bytes = b"bytes") -> None:
    facts = {"name": name, "type": "", "size": len(content), "last_modified": datetime(2026, 1, 1, tzinfo=UTC)}
    files._rows[kind][0].value = ({**facts, "content": content},)


def test_nothing_picked_is_nothing():
    files = OwnFiles()
    assert (files.song, files.dance) == (None, None)


@pytest.mark.parametrize("name", ["my song.WAV", "../../song.wav", "/etc/passwd.wav", "a\x00b.wav", "<b>.wav"])
def test_an_upload_is_kept_under_a_name_of_ours(name: str):
    files = OwnFiles()
    upload(files, "song", name, b"planted")
    assert (files.song.name, files.song.parent) == ("song.wav", Path(files._folder.name))
    assert files.song.read_bytes() == b"planted"


@pytest.mark.parametrize("name", ["", "song", ".wav", "song.w/av", "song.a b", "song." + "a" * 99, "song.wäv"])
def test_an_upload_without_a_plain_ending_is_refused(name: str):
    files = OwnFiles()
    upload(files, "song", name)
    with pytest.raises(ValueError, match=r"the song needs a name that ends in its format"):
        _ = files.song


def test_a_path_goes_before_an_upload(tmp_path: Path):
    files = OwnFiles()
    upload(files, "dance", "dance.bvh")
    files._rows["dance"][1].value = f"  {tmp_path / 'film.mp4'} "
    assert files.dance == tmp_path / "film.mp4"


def test_a_video_alone_is_its_own_song_and_a_motion_is_not(tmp_path: Path):
    files = OwnFiles()
    upload(files, "dance", "me.MP4")
    assert files.song == files.dance == Path(files._folder.name) / "dance.mp4"
    upload(files, "song", "song.wav")
    assert files.song.name == "song.wav"
    upload(other := OwnFiles(), "dance", "dance.bvh")
    assert other.song is None


def test_page_without_widgets_says_where_files_are_picked():
    assert OwnFiles()._repr_mimebundle_()["text/plain"] == "pick your files in JupyterLab"
