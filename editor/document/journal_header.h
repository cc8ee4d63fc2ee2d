// SPDX-License-Identifier: GPL-3.0-or-later
// What a document's journal begins with: what the edits in it begin from.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cellwarp::core
{

struct JournalHeader
{
    std::string document;       ///< path as it was opened
    std::string scene, handles; ///< texts of what it said then
    std::string handles_path;   ///< as which the second one is read
    std::uint64_t model_bytes = 0;
    std::uint32_t model_checksum = 0;
};

std::string header_text(const JournalHeader& header);
/// Throws Fault::Malformed; \p path names the journal.
JournalHeader parse_header(std::string_view text, const std::string& path);

} // namespace cellwarp::core
