// SPDX-License-Identifier: GPL-3.0-or-later
// Names of files inside files: relative to the folder of the file that says them.
#pragma once

#include <string>

namespace cellwarp::core
{

/// Where \p name leads that \p file says.
std::string resolved_name(const std::string& file, const std::string& name);

/// What \p file says to mean \p target, as resolved_name() undoes it: relative if the two
/// have more than the root folder in common, otherwise absolute. Links of folders are
/// followed, a link that is the target itself is not. Throws Fault::File where no such
/// name can be found, as when the working folder is gone.
std::string relative_name(const std::string& file, const std::string& target);

} // namespace cellwarp::core
