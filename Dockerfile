# softgym_mj on a CPU, with OpenGL by software:
#     docker build -t softgym_mj . && docker run --rm -v "$PWD/demo:/work/demo" softgym_mj demo
FROM python:3.12-slim AS build
RUN apt-get update && apt-get install -y --no-install-recommends g++ make && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheel /source

FROM python:3.12-slim
RUN apt-get update && apt-get install -y --no-install-recommends \
        libegl1 libgl1-mesa-dri libopengl0 \
    && rm -rf /var/lib/apt/lists/*
# Cloth and rope are single-threaded; without it every worker starts a thread per core.
ENV MUJOCO_GL=egl OMP_NUM_THREADS=1
RUN --mount=from=build,source=/wheel,target=/wheel pip install --no-cache-dir /wheel/*.whl
WORKDIR /work
ENTRYPOINT ["softgym-mj"]
