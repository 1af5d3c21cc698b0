# The demo in a container:
#
#     docker build -t bowden .
#     docker run --rm -v "$PWD/out:/bowden/out" bowden
#
# writes its page to out/demo on the host. Any other command follows the name: docker run --rm -it bowden bowden doctor.
FROM python:3.13-slim

RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/*

WORKDIR /bowden
ENV PATH=/bowden/.venv/bin:$PATH MPLBACKEND=agg

# What bowden needs, before its own files, so that a change of those does not install it all again.
COPY pyproject.toml README.md LICENSE Makefile ./
COPY requirements ./requirements
COPY src/bowden/__init__.py src/bowden/__init__.py
RUN make LOCKED=1 .venv/runtime

COPY src ./src

CMD ["make", "LOCKED=1", "demo"]
