// SPDX-License-Identifier: GPL-3.0-or-later
// The mark of all that the shared library shows. An exception needs it too: without it a
// `catch (const cellwarp::Error&)` in another library would not match.
#pragma once

#define CELLWARP_API __attribute__((visibility("default")))
