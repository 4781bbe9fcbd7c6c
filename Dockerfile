# One image a service, none with more than it needs: docker compose builds the targets router, sim, planner, controller, gateway, viewer.

FROM python:3.11-slim-bookworm AS python
ENV PYTHONUNBUFFERED=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
RUN python -m venv /venv
ENV PATH=/venv/bin:$PATH

# What a service imports is installed before its code is copied: a change of code installs nothing anew.
FROM python AS dependencies
WORKDIR /src
COPY pyproject.toml ./
COPY docker/requirements.py docker/

FROM dependencies AS build-router
RUN python docker/requirements.py core >core.txt && pip install -r core.txt
COPY . .
RUN pip install --no-deps .

FROM dependencies AS build-sim
RUN python docker/requirements.py core sim >sim.txt && pip install -r sim.txt
COPY . .
RUN pip install --no-deps .

FROM dependencies AS build-planner
RUN python docker/requirements.py core planner >planner.txt && pip install -r planner.txt
COPY . .
RUN pip install --no-deps .

FROM dependencies AS build-controller
RUN python docker/requirements.py core controller >controller.txt && pip install -r controller.txt
COPY . .
RUN pip install --no-deps .

FROM dependencies AS build-gateway
RUN python docker/requirements.py core gateway >gateway.txt && pip install -r gateway.txt
COPY . .
RUN pip install --no-deps .

FROM dependencies AS build-viewer
RUN python docker/requirements.py core viewer >viewer.txt && pip install -r viewer.txt
COPY . .
RUN pip install --no-deps .

# What runs: an interpreter, one environment, a user without rights, and two folders that are his: /state outlives
# the container (a volume), /cache holds what numba compiled.
FROM python AS runtime
RUN useradd --uid 10001 --no-create-home --home-dir /tmp --shell /usr/sbin/nologin rackhand \
 && mkdir /state /cache && chown rackhand: /state /cache
ENV NUMBA_CACHE_DIR=/cache RACKHAND_BUS_CONNECT=tcp/router:7447 RACKHAND_BUS_LISTEN=tcp/0.0.0.0:0
WORKDIR /state
USER rackhand

FROM runtime AS router
COPY --from=build-router /venv /venv
CMD ["python", "-m", "rackhand.bus.router", "--listen", "tcp/0.0.0.0:7447"]
EXPOSE 7447

FROM runtime AS sim
COPY --from=build-sim /venv /venv
# Compiled here once, so that no container has to before it is ready.
RUN python -m rackhand.services.sim.warm_up
CMD ["python", "-m", "rackhand.services.sim", "--wait-for", "amr1/planner", "--wait-for", "arm1/controller"]

FROM runtime AS planner
COPY --from=build-planner /venv /venv
COPY worlds /worlds
# Compiled here once, so that no container has to before it is ready.
RUN python -m rackhand.services.planner.warm_up
CMD ["python", "-m", "rackhand.services.planner", "--robot", "amr1", "--map", "/worlds/warehouse", "--store", "/state/planner.sqlite"]

FROM runtime AS controller
# pinocchio wants OpenMP's library, which the slim image lacks.
USER root
RUN python -c "import ctypes; ctypes.CDLL('libgomp.so.1')" 2>/dev/null \
 || (apt-get update && apt-get install -y --no-install-recommends libgomp1 && rm -rf /var/lib/apt/lists/*)
USER rackhand
COPY --from=build-controller /venv /venv
# Compiled here once, so that no container has to before it is ready.
RUN python -m rackhand.services.controller.warm_up
CMD ["python", "-m", "rackhand.services.controller", "--robot", "arm1", "--arm", "ur5e", "--state-dir", "/state"]

FROM runtime AS gateway
COPY --from=build-gateway /venv /venv
CMD ["python", "-m", "rackhand.services.gateway", "--robot", "amr1", "--arm", "arm1", "--host", "0.0.0.0", "--port", "8090"]
EXPOSE 8090

FROM runtime AS viewer
COPY --from=build-viewer /venv /venv
CMD ["python", "-m", "rackhand.services.viewer", "--host", "0.0.0.0"]
EXPOSE 9090 9876
