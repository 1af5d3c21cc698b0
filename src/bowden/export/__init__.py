"""From kernels to C99: their source is read, and written as code for a microcontroller (`bowden.export`)."""
