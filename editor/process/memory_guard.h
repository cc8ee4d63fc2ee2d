// SPDX-License-Identifier: GPL-3.0-or-later
// How a program takes its memory, and its end when none is left, also where a library
// cannot say so. All that cellwarp sets for a whole process is set here, by its programs:
// what other programs link sets nothing.
#pragma once

namespace cellwarp::core
{

/// To be made before main(), by a static variable of the highest priority: from then on
/// an allocation that fails ends the process with a message and Fault::Budget as exit
/// code. Unfinished outputs are removed. What was freed is taken again before the system
/// is asked for more.
class MemoryGuard
{
public:
    /// What a library means that calls exit(): in a program without a window that it has
    /// no memory for its threads.
    enum class LibraryExit
    {
        NoMemory,
        Anything
    };
    explicit MemoryGuard(LibraryExit library_exit);

    /// The body of main(): calls \p run, and ends the process by what it returns.
    int main(int (*run)(int, char**), int argc, char** argv) const;
};

} // namespace cellwarp::core
