"""What bowden does, each operation once: a typed function with a frozen result.

The command line, the functions of ``import bowden``, ``--json``, ``bowden schema`` and the console's work are made of
its signature, annotations and docstring (`bowden.operations.support`); `bowden.views` shows and writes a result.
"""
