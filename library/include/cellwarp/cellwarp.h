// SPDX-License-Identifier: GPL-3.0-or-later
// The whole library. Within 0.x its interface may change from one minor version to the
// next, and the name of the shared library changes with it; the CHANGELOG lists each
// change. Files and the command line stay compatible.
#pragma once

#include <cellwarp/control.h>
#include <cellwarp/deform.h>
#include <cellwarp/drag.h>
#include <cellwarp/edit.h>
#include <cellwarp/error.h>
#include <cellwarp/field.h>
#include <cellwarp/model.h>
#include <cellwarp/points.h>
#include <cellwarp/report.h>
#include <cellwarp/session.h>
#include <cellwarp/settings.h>
#include <cellwarp/simulation.h>
#include <cellwarp/skeleton.h>
#include <cellwarp/study.h>
#include <cellwarp/version.h>
