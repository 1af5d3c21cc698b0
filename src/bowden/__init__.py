"""bowden: an open control stack for soft exosuits driven through Bowden cables.

A cable in a sheath loses motion: friction and play make a hysteresis that changes whenever the sheath bends. The
package takes a log of such a cable to an identified model, and the model to a controller that makes the joint follow.

Layers, imports pointing down only: ``core < models < control < sim, identify < report < paper < app``.
"""

__version__ = "0.1.0"
