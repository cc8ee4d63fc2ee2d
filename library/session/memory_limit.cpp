// SPDX-License-Identifier: GPL-3.0-or-later
// The system tells which groups a process is in by /proc/self/cgroup, a path for each
// hierarchy (cgroups(7)), and where the hierarchies are by /proc/self/mountinfo
// (proc(5)). A mount may show a part of its hierarchy only: from its root on.
#include "library/session/memory_limit.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include <unistd.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/gltf_memory.h"
#include "library/session/large_heap.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

constexpr double kShare = 0.7, kBytesPerKilobyte = 1024.0;
/// What reading takes of memory for each byte of a file, as measured, by format. For all
/// others it is that of text in columns; the buffers beside a .gltf are not counted.
/// JSON takes more, see JsonSize.
constexpr std::pair<std::string_view, double> kOfFiles[] = {
    {"obj", 3.8}, {"off", 3.8}, {"ply", 5.3}, {"stl", 8.9}};
constexpr double kOfOtherFiles = 1.9;
/// For each byte that compressed data of a glTF unpack to.
constexpr double kOfUnpacked = 8.0;
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Memory that values of JSON text need beside the text, as measured: a member of an
/// object with its name, a value behind a comma, a list or object [byte].
constexpr double kOfMember = 128.0, kOfNext = 32.0, kOfBracket = 40.0;
/// For each byte of the text, at the most.
constexpr double kMostOfJson = 36.0;

/// Adds up what JSON text takes, part by part: what stands in quotes has no values.
class JsonSize
{
public:
    void add(std::string_view text)
    {
        for (const char c : text)
            if (is_escaped_)
                is_escaped_ = false;
            else if (is_quoted_)
            {
                is_escaped_ = c == '\\';
                is_quoted_ = c != '"';
            }
            else
            {
                is_quoted_ = c == '"';
                bytes_ += c == ':'               ? kOfMember
                          : c == ','             ? kOfNext
                          : c == '[' || c == '{' ? kOfBracket
                                                 : 0.0;
            }
    }
    double bytes() const { return bytes_; }

private:
    bool is_quoted_ = false, is_escaped_ = false;
    double bytes_ = 0.0;
};

/// Start and length of the JSON in a glTF file of \p size [byte].
std::pair<double, double> json_of(const std::string& path, double size)
{
    if (extension_of(path) != "glb")
        return {0.0, size};
    // Magic word, version, length; length and type of the JSON.
    std::array<std::uint32_t, 5> head{};
    std::ifstream file(path, std::ios::binary);
    if (!file.read(reinterpret_cast<char*>(head.data()), sizeof head))
        return {0.0, 0.0};
    const double start = sizeof head;
    return {start, std::min(size - start, static_cast<double>(head[3]))};
}

/// Memory that the JSON of a glTF file of \p size needs beside its text [byte]. The text
/// is read only where the most that it can need is more than \p room.
double bytes_of_json(const std::string& path, double size, double room)
{
    auto [start, left] = json_of(path, size);
    if (kMostOfJson * left <= room)
        return kMostOfJson * left;
    std::ifstream file(path, std::ios::binary);
    file.seekg(static_cast<std::streamoff>(start));
    JsonSize json;
    std::string part;
    while (left > 0.0 && file)
    {
        part.resize(static_cast<std::size_t>(std::min(left, 65536.0)));
        file.read(part.data(), static_cast<std::streamsize>(part.size()));
        json.add(
            std::string_view(part).substr(0, static_cast<std::size_t>(file.gcount())));
        left -= static_cast<double>(part.size());
    }
    return json.bytes();
}

/// Size of the compressed data of a glTF file of \p size when unpacked, as the file
/// states it [byte]. \pre its JSON fits into the memory
double unpacked_bytes(const std::string& path, double size)
{
    const auto [start, length] = json_of(path, size);
    std::string json(static_cast<std::size_t>(length), '\0');
    std::ifstream file(path, std::ios::binary);
    file.seekg(static_cast<std::streamoff>(start));
    file.read(json.data(), static_cast<std::streamsize>(json.size()));
    return unpacked_gltf_bytes(json);
}

/// The files of a control group, by its version.
struct Names
{
    const char *limit, *usage, *inactive, *active;
};
constexpr Names kNamesV1 = {"memory.limit_in_bytes", "memory.usage_in_bytes",
                            "total_inactive_file", "total_active_file"},
                kNamesV2 = {"memory.max", "memory.current", "inactive_file",
                            "active_file"};

std::vector<std::string> words_of(const std::string& line)
{
    std::istringstream in(line);
    std::vector<std::string> words;
    for (std::string word; in >> word;)
        words.push_back(word);
    return words;
}

/// The number after a word at the beginning of a line.
std::optional<double> number_after(const fs::path& file, std::string_view name)
{
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);)
        if (const std::vector<std::string> words = words_of(line);
            words.size() >= 2 && words[0] == name)
            return parse_double(words[1]);
    return std::nullopt;
}

/// The number that a file is; nothing for "max".
std::optional<double> number_in(const fs::path& file)
{
    std::ifstream in(file);
    std::string word;
    in >> word;
    return parse_double(word);
}

/// What one group leaves to its processes: what it may take less what it has, without the
/// pages of files that the system takes back when it needs them.
double left_in(const fs::path& group, const Names& names)
{
    const std::optional<double> limit = number_in(group / names.limit);
    if (!limit)
        return kUnlimited;
    const fs::path stat = group / "memory.stat";
    const double files = number_after(stat, names.inactive).value_or(0.0) +
                         number_after(stat, names.active).value_or(0.0);
    const double taken = number_in(group / names.usage).value_or(0.0) - files;
    return std::max(0.0, *limit - std::max(0.0, taken));
}

/// Blanks and the like stand as \\ and three octal digits.
std::string unescaped(const std::string& text)
{
    const auto digit = [](char c) { return c - '0'; };
    std::string out;
    for (std::size_t i = 0; i < text.size(); ++i)
        if (text[i] == '\\' && i + 3 < text.size())
        {
            out += static_cast<char>(64 * digit(text[i + 1]) + 8 * digit(text[i + 2]) +
                                     digit(text[i + 3]));
            i += 3;
        }
        else
            out += text[i];
    return out;
}

bool has_memory(std::string_view list)
{
    return ("," + std::string(list) + ",").find(",memory,") != std::string::npos;
}

/// A hierarchy of groups that holds memory, as it is mounted.
struct Mount
{
    fs::path root, place;
    bool is_v1;
};

std::vector<Mount> memory_mounts(const std::string& proc)
{
    std::vector<Mount> mounts;
    std::ifstream in(proc + "/self/mountinfo");
    for (std::string line; std::getline(in, line);)
    {
        // ... root place options [tags] - type source options
        const std::vector<std::string> words = words_of(line);
        const auto dash = std::find(words.begin(), words.end(), "-");
        if (words.size() < 6 || words.end() - dash < 4)
            continue;
        const bool is_v1 = dash[1] == "cgroup" && has_memory(dash[3]);
        if (is_v1 || dash[1] == "cgroup2")
            mounts.push_back({unescaped(words[3]), unescaped(words[4]), is_v1});
    }
    return mounts;
}

/// What a group and all above it leave, as far as the mount shows them.
double left_from(const Mount& mount, const fs::path& group)
{
    // One that lies outside of what is shown has its limits told by the mount's own root.
    fs::path below = group.lexically_relative(mount.root);
    if (below.empty() || *below.begin() == "..")
        below = ".";
    double left = kUnlimited;
    for (fs::path path = (mount.place / below).lexically_normal();;
         path = path.parent_path())
    {
        left = std::min(left, left_in(path, mount.is_v1 ? kNamesV1 : kNamesV2));
        const fs::path above = path.lexically_relative(mount.place);
        if (above.empty() || above == "." || path == path.parent_path())
            return left;
    }
}

double left_in_groups(const std::string& proc)
{
    const std::vector<Mount> mounts = memory_mounts(proc);
    double left = kUnlimited;
    std::ifstream in(proc + "/self/cgroup");
    for (std::string line; std::getline(in, line);)
    {
        // number:controllers:path; version 2 names no controllers
        const std::size_t first = line.find(':'), second = line.find(':', first + 1);
        if (first == std::string::npos || second == std::string::npos)
            continue;
        const std::string controllers = line.substr(first + 1, second - first - 1);
        for (const Mount& mount : mounts)
            if (mount.is_v1 ? has_memory(controllers) : controllers.empty())
                left = std::min(left, left_from(mount, line.substr(second + 1)));
    }
    return left;
}

} // namespace

double resident_memory(const std::string& proc)
{
    std::ifstream in(proc + "/self/statm");
    double all = 0.0, resident = 0.0; // [page]
    return in >> all >> resident ? resident * static_cast<double>(::sysconf(_SC_PAGESIZE))
                                 : 0.0;
}

double default_memory_limit(const std::string& proc)
{
    const std::optional<double> available =
        number_after(proc + "/meminfo", "MemAvailable:");
    const double left = std::min(available ? kBytesPerKilobyte * *available : kUnlimited,
                                 left_in_groups(proc));
    // Not even one byte is left is another thing than that there is no limit.
    return left < kUnlimited ? resident_memory(proc) + std::max(1.0, kShare * left) : 0.0;
}

double memory_with(double more, double max_memory)
{
    const double bytes = resident_memory() + more;
    if (!(max_memory > 0) || bytes <= max_memory)
        return bytes;
    release_freed_memory();
    return resident_memory() + more;
}

void check_memory_of_file(const std::string& path, double max_memory)
{
    std::error_code missing;
    const std::uintmax_t size = fs::file_size(path, missing);
    if (missing || !(max_memory > 0))
        return;
    const std::string extension = extension_of(path);
    double factor = kOfOtherFiles;
    for (const auto& [of, times] : kOfFiles)
        if (extension == of)
            factor = times;
    double more = factor * static_cast<double>(size);
    if (extension == "gltf" || extension == "glb")
    {
        more += bytes_of_json(path, static_cast<double>(size),
                              max_memory - resident_memory() - more);
        if (memory_with(more, max_memory) <= max_memory)
            more += kOfUnpacked * unpacked_bytes(path, static_cast<double>(size));
    }
    const double bytes = memory_with(more, max_memory);
    if (bytes > max_memory)
        throw Error(Fault::Budget,
                    at({path, 0, ""}, "a file of " + in_bytes(static_cast<double>(size)) +
                                          " needs about " + in_bytes(bytes) + " (limit " +
                                          in_bytes(max_memory) + ")"));
}

} // namespace cellwarp::core
