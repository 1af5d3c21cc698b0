"""The live loop: session, processes, recorder, logs, replay."""
