# `rlacd batch` in a container, without a compiler in the final image:
#
#   docker build -t rlacd .
#   docker run --rm -v "$PWD/assets:/in:ro" -v "$PWD/hulls:/out" rlacd /in -o /out
FROM python:3.12-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends g++ && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY pyproject.toml CMakeLists.txt README.md LICENSE ./
COPY native native
COPY src src
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim
COPY --from=build /wheels /wheels
RUN wheel="$(ls /wheels/*.whl)" && pip install --no-cache-dir "${wheel}[fleet]" && rm -rf /wheels \
 && useradd --create-home rlacd
USER rlacd
WORKDIR /home/rlacd
ENTRYPOINT ["rlacd", "batch"]
