// SPDX-License-Identifier: GPL-3.0-or-later
// kill -9 while a document is edited: at most the last edit is lost. The process that is
// killed is this program anew, for a fork alone has none of the threads that it may need.
#include <cstdlib>

#include <csignal>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "octree/base/index.h"
#include "tests/editor/document/random_edits.h"

namespace cellwarp::core
{

namespace
{

constexpr int kKills = 50;
constexpr int kSteps = 300;

/// What the process that is killed is told.
constexpr const char* kModel = "CELLWARP_KILLED_MODEL";
constexpr const char* kJournals = "CELLWARP_KILLED_JOURNALS";
constexpr const char* kFirstStep = "CELLWARP_KILLED_FIRST_STEP";
constexpr const char* kReports = "CELLWARP_KILLED_REPORTS";

/// The same in every process that has the document in the same state.
void do_step(Document& document, int step)
{
    std::mt19937 rng(1000 + static_cast<unsigned>(step));
    switch (rng() % 12)
    {
    case 0:
        document.undo();
        break;
    case 1:
        document.redo();
        break;
    case 2:
        document.go_to(rng() % (document.history().size() + 1));
        break;
    default:
        support::edit_at_random(document, rng);
    }
}

std::string state_of(const Document& document)
{
    const History& history = document.history();
    std::string text = support::contents(document) + std::to_string(history.position());
    for (std::size_t k = 0; k < history.size(); ++k)
        text += "\n" + history.name(k);
    return text;
}

/// After each number of steps.
std::vector<std::string> expected_states(const support::BarDocument& bar)
{
    Document document = bar.open(false);
    std::vector<std::string> states = {state_of(document)};
    for (int step = 0; step < kSteps; ++step)
    {
        do_step(document, step);
        states.push_back(state_of(document));
    }
    return states;
}

struct Child
{
    pid_t process = -1;
    int reports = -1; ///< a byte for each step that is done
};

Child start_child(const support::BarDocument& bar, int first_step)
{
    int ends[2];
    EXPECT_EQ(::pipe(ends), 0);
    EXPECT_EQ(::fcntl(ends[0], F_SETFD, FD_CLOEXEC), 0);
    ::setenv(kModel, bar.model.c_str(), 1);
    ::setenv(kJournals, bar.journals.c_str(), 1);
    ::setenv(kFirstStep, std::to_string(first_step).c_str(), 1);
    ::setenv(kReports, std::to_string(ends[1]).c_str(), 1);
    const pid_t child = ::fork();
    if (child == 0)
    {
        ::dup2(::open("/dev/null", O_WRONLY | O_CLOEXEC), 1);
        ::execl("/proc/self/exe", "tests",
                "--gtest_filter=JournalKill.the_process_that_is_killed",
                static_cast<char*>(nullptr));
        ::_exit(99);
    }
    ::close(ends[1]);
    return {child, ends[0]};
}

/// Kills the child some time after it has reported so many steps; gives all it has
/// reported.
int kill_after(const Child& child, int steps, useconds_t pause)
{
    int reported = 0;
    char byte = 0;
    while (reported < steps && ::read(child.reports, &byte, 1) == 1)
        ++reported;
    ::usleep(pause);
    ::kill(child.process, SIGKILL);
    int status = 0;
    ::waitpid(child.process, &status, 0);
    EXPECT_EQ(status & 0x7f, SIGKILL);
    while (::read(child.reports, &byte, 1) == 1)
        ++reported;
    ::close(child.reports);
    return reported;
}

} // namespace

TEST(JournalKill, the_process_that_is_killed)
{
    const char* const model = std::getenv(kModel);
    if (!model)
        GTEST_SKIP() << "for the test below";
    Document document(model, std::getenv(kJournals));
    document.recover();
    const int reports = std::atoi(std::getenv(kReports));
    for (int step = std::atoi(std::getenv(kFirstStep)); step < kSteps; ++step)
    {
        do_step(document, step);
        ASSERT_EQ(::write(reports, "x", 1), 1);
    }
    ::pause();
}

TEST(JournalKill, loses_at_most_the_last_edit_at_any_moment)
{
    const support::BarDocument bar;
    const std::vector<std::string> states = expected_states(bar);
    std::mt19937 rng(4);
    int step = 0, most = 0, in_an_edit = 0;
    for (int k = 0; k < kKills; ++k)
    {
        SCOPED_TRACE(k);
        // From nothing, while it opens and recovers, or between and in its edits.
        const Child child = start_child(bar, step);
        const int reported = kill_after(child, static_cast<int>(rng() % 12), rng() % 400);
        Document document = bar.open();
        document.recover();
        const std::string state = state_of(document);
        const auto is = [&](int steps)
        { return steps <= kSteps && state == states[idx(steps)]; };
        const bool has_one_more = !is(step + reported);
        ASSERT_TRUE(!has_one_more || is(step + reported + 1))
            << "after " << step << " steps and " << reported << " more:\n"
            << state;
        in_an_edit += has_one_more;
        step += reported + has_one_more;
        most = std::max(most, step);
        if (step > kSteps * 3 / 4)
        {
            document.close();
            step = 0;
        }
    }
    EXPECT_GT(most, 50);
    std::printf("%d kills, %d of them between an edit and its report\n", kKills,
                in_an_edit);
}

} // namespace cellwarp::core
