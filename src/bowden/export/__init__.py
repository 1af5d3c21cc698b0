"""From kernels to C99: their source is read, and written as code for a microcontroller.

Called, it is `bowden.export`:

>>> import tempfile
>>> import bowden
>>> found = bowden.export(bowden.Rig(duration=2.0), tempfile.mkdtemp(), "uncompensated")
>>> found.precision, found.check
('double', 'holds')
"""
