"""Results for people: tables and next steps in a terminal, and the files that are written of a result.

``views/NAME.py``, or ``views/short.py`` of a few lines, has ``show_NAME(result, call)`` for the operation NAME of
``operations/NAME.py``, and ``write_NAME(result, call, …)`` where files are written, whose further parameters are
options of the command.
"""
