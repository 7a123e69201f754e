# The stack with ROS as wheels, and a browser for the tests of the live page.  docs/tutorial.md shows how to use it.
FROM debian:bookworm-slim

RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        chromium gcc git libc6-dev libegl1 libgl1 libgomp1 libosmesa6 make procps python3 python3-dev python3-venv \
    && rm -rf /var/lib/apt/lists/*

# a user of its own: Chromium and the tests of permissions want no root
RUN useradd --create-home --uid 1000 wam
WORKDIR /wam_stack
RUN chown wam:wam /wam_stack
USER wam

# the dependencies change rarely: a layer of their own
COPY --chown=wam:wam Makefile constraints.txt setup.py setup.cfg pyproject.toml package.xml ./
COPY --chown=wam:wam resource resource
COPY --chown=wam:wam scripts scripts
COPY --chown=wam:wam wam_description/nodes.py wam_description/nodes.py
RUN make dependencies

COPY --chown=wam:wam . .
RUN make install

ENV PATH=/wam_stack/.venv/bin:$PATH
CMD ["make", "demo"]
