# SPDX-License-Identifier: GPL-3.0-or-later
# The two commands of the README on a bare Debian 12.
FROM debian:12
COPY . /cellwarp
WORKDIR /cellwarp
RUN scripts/run
RUN scripts/test
