"""The families of drives: a file a family, whose ``FAMILY`` says how it is spoken to and who plays it without a rig.

A new family is a file here and its twin; ``[drive] family`` of a rig is the file's name.
"""
