// SPDX-License-Identifier: GPL-3.0-or-later
// Linux keeps the peak as VmHWM in /proc/self/status, and sets it to the present size
// when a 5 is written to /proc/self/clear_refs (proc(5)).
#include "library/session/peak_memory.h"

#include <fstream>
#include <optional>
#include <sstream>
#include <string>

#include <sys/resource.h>

#include "library/session/large_heap.h"

namespace cellwarp::core
{

namespace
{

constexpr double kKilobytesPerMb = 1024.0;

/// [kB]; nothing where the system does not tell.
std::optional<double> high_water_mark()
{
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.starts_with("VmHWM:"))
        {
            std::istringstream number(line.substr(line.find(':') + 1));
            double kilobytes = 0.0;
            if (number >> kilobytes)
                return kilobytes;
        }
    return std::nullopt;
}

bool forget_peak()
{
    std::ofstream clear("/proc/self/clear_refs");
    clear << "5" << std::flush;
    return clear.good() && high_water_mark();
}

} // namespace

PeakMemory::PeakMemory()
{
    release_freed_memory();
    is_since_start_ = forget_peak();
}

double PeakMemory::mb() const
{
    const std::optional<double> since_start =
        is_since_start_ ? high_water_mark() : std::nullopt;
    return since_start ? *since_start / kKilobytesPerMb : peak_memory_mb();
}

double peak_memory_mb()
{
    // What getrusage() tells holds the peak of the parent, too, if that is higher.
    if (const std::optional<double> kilobytes = high_water_mark())
        return *kilobytes / kKilobytesPerMb;
    struct rusage usage
    {
    };
    ::getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / kKilobytesPerMb;
}

} // namespace cellwarp::core
