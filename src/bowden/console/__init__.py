"""The console: a rig run from a browser. What may be done over the wire, and who does it: docs/decisions/0036."""
