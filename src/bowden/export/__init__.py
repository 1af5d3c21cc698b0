"""From kernels to C99: the same equations, traced as they run and written as code for a microcontroller."""
