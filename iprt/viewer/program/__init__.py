"""Viewers as programs control them, in the same process or another.

`control` describes the methods once. `handle` is a viewer of this process, for notebooks. `client`
calls the same methods of a viewer that `iprt view` started, through its `listener`.
"""
