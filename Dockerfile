# SPDX-License-Identifier: Apache-2.0
# locfuse with its studio: open http://127.0.0.1:8642 with the token that it prints.
#   docker build -t locfuse .
#   docker run --rm -p 127.0.0.1:8642:8642 -v "$PWD:/drives" locfuse
# Any other command: docker run --rm -v "$PWD:/drives" locfuse locfuse demo
FROM debian:bookworm-slim AS build
WORKDIR /locfuse
RUN apt-get update
RUN apt-get install -y --no-install-recommends g++ cmake ninja-build libeigen3-dev libboost-dev libnanoflann-dev libceres-dev python3-dev python3-venv ca-certificates
RUN python3 -m venv /usr/local/locfuse
COPY . .
RUN /usr/local/locfuse/bin/pip install --config-settings=cmake.define.LOCFUSE_WITH_PCL=OFF ".[plots,bags,studio,sweep]"

FROM debian:bookworm-slim
RUN apt-get update
RUN apt-get install -y --no-install-recommends python3 libceres3
COPY --from=build /usr/local/locfuse /usr/local/locfuse
ENV PATH=/usr/local/locfuse/bin:/usr/bin:/bin
WORKDIR /drives
EXPOSE 8642
CMD ["locfuse", "studio", "--host", "0.0.0.0"]
