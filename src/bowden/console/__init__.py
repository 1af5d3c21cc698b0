"""The console: a rig run from a browser. What may be done over the wire, and who does it: web/README.md and
docs/decisions/0018-console.md."""
