"""Retiming by time-warp: a motion's own poses, struck when the music's beats come.

`harmolab.retiming` is the other way to the same end: there joints move a little and time stays.
"""
