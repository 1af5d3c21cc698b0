"""From a log of a cable to a model that predicts what it has not seen; called, it is `bowden.identify`.

>>> import bowden
>>> import numpy as np
>>> time = np.arange(0.0, 20.0, 0.01)
>>> motor = 0.5 * np.sin(2.0 * time)
>>> fit = bowden.identify(time, motor, 0.9 * motor + 0.1)
>>> fit.best.name, round(fit.best.parameters["slope"], 6)
('line', 0.9)
"""
