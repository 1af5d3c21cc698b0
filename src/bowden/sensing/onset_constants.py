"""Statistics of rest and of disturbances: constants of `bowden.sensing.onset`, for signals in any unit.

They say what skin, electrodes, amplifiers and mains do, and are the same for all wearers and recordings; so they are no
settings.
"""

BANDWIDTH = 100.0
"""Of a muscle's spectrum: this many independent pairs of samples there are in a second [Hz]."""
BAND_HZ = 40.0
"""Lower end of the band: the corner of a twofold high-pass [Hz]."""
TOP_HZ = 400.0
"""Upper end of the band, where the rate has it; a muscle has little beyond [Hz]."""
WIDE_HZ = 20.0
"""Lower end of all that is not slow: muscle, mains, and the quick part of movement [Hz]."""
SWING_HZ = 5.0
"""Lower end of movement [Hz]."""
SURE = 1.5
"""Rest is taken for at most its level and this many standard deviations [–]."""
UNKNOWN = 1.4
"""Standard deviation of the log of rest's power, of which nothing has been seen yet: a factor of two in size."""
CHANGED = 0.7
"""The same of the rest that follows a contraction: pauses of one recording differ from the one before by 0.65, 0.77 and
1.3 (RMS) where muscles relax for a second, by 0.1 where they do for ten."""
LEARNT = 1.5
"""By e less of these variances in this much rest [s]."""
FAMILIAR = 0.5
"""Variance of what is unknown below which rest is taken as it is, and a wearer's file bounds it no longer: 2 s of rest
have been seen."""
MUTED = 0.1
"""What is smaller than this share of a wearer's least rest is no rest of theirs, as of an amplifier that is muted:
nothing is learned from it of how far rest may be off. Pauses of one recording differ by less."""
SPREAD = 0.2
"""Standard deviation of the log of power, averaged over 0.1 s, of noise as wide as the band."""
WEIGHT = 3.0
"""That counts as much as this much of rest that is seen [s]."""
MEMORY = 12.0
"""Rest older than this does not count [s]."""
FALLS = 0.3
"""Time constant of a level that was taken for too high: a muscle that contracted from the start [s]."""
DOUBT = 0.15
"""What is larger than rest is learnt this much slower: it may be a contraction [–]."""
FORGET = 0.05
"""So much less of rest is known with each second of a contraction: what is well known outlasts minutes [–]."""
TAIL_SHARE = 0.1
"""Size of what a contraction leaves when it has ended, over its own [–]."""
MOVED = 0.001
"""Power in the band of movement, over the square of its recent peak [–]."""
BROAD = 0.01
"""Power in the band of movement and mains, over that above `WIDE_HZ` [–]."""
REPEATS = 0.03
"""Power of hum that is left after subtracting what was one period ago, over that in the band [–]."""
MAINS_LEVEL = 0.1
"""Least share of the movement's squared peak that the power of mains has; a slow swing has less [–]."""
STAYS = 1.0
"""Time constant of the share of time that mains cover; above half of it the input is another when they go [s]."""
GONE = 0.25
"""Below this share of their power mains have gone [–]."""
SILENT = 1e-12
"""σ of a signal that is none, in whatever unit."""
FLAT = 0.02
"""A value that lasts this long is no signal [s]."""
LIFTED = 0.5
"""A value that lasts this long is an electrode that is off: rest is measured again [s]."""
STILL = 0.05
"""A step from one sample to the next that is less than this share of the recent largest is none [–]."""
STUCK = 0.6
"""Share of samples without a step that is too much [–]."""
STEPS = 0.1
"""As long as the power is more than this share of that step's square [–]."""
STEEP_HZ, SLOW_HZ = 30.0, 15.0
"""Upper ends of two bands that begin at `WIDE_HZ` and `SWING_HZ`: a swing has much in both, a muscle little [Hz]."""
STEEP = 0.3
"""Power in the band of a swing, over that from `WIDE_HZ` to `STEEP_HZ`: noise that falls with the fourth power of the
frequency from below 20 Hz on has 0.23 [–]."""
SLOW = 0.02
"""The same, at most, over the square of the recent peak from `SWING_HZ` to `SLOW_HZ` [–]."""
