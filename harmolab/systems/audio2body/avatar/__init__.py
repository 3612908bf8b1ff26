"""From a musician's points in a picture to an avatar in space, with instrument and bow (Sec. 5), in seven steps."""

from harmolab.systems.audio2body.avatar.build import avatar
from harmolab.systems.audio2body.avatar.params import AvatarParams

__all__ = ["AvatarParams", "avatar"]
