// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/contact_rounds.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Whether a contact was solved with, from the same side.
bool is_known(const FoundContact& found, const std::vector<FoundContact>& contacts)
{
    constexpr double kSameSide = 0.9; // cosine
    const auto known = std::lower_bound(contacts.begin(), contacts.end(), found.point,
                                        [](const FoundContact& other, std::size_t point)
                                        { return other.point < point; });
    return known != contacts.end() && known->point == found.point &&
           known->contact.b == found.contact.b &&
           known->contact.outward.dot(found.contact.outward) >= kSameSide;
}

} // namespace

SolveReport solve_in_contact(const SolvedInContact& of, const SolveOptions& options)
{
    constexpr int kRounds = 8;
    constexpr double kLoose = 1e-3; // gradient of all rounds but the last
    // No reason for another round, and none to say that it did not end [voxel].
    constexpr double kShallow = 0.25, kFair = 1.0;
    const Clock::time_point start = Clock::now();
    const auto take = [&](std::vector<FoundContact> found)
    {
        if (found.empty() && of.contacts.empty())
            return;
        of.contacts = std::move(found);
        of.has_changed();
    };
    take(of.finder.find(of.poses));
    bool is_last = of.contacts.empty() || options.gradient_tolerance >= kLoose;
    const auto options_after = [&](int iterations)
    {
        SolveOptions now = options;
        if (!is_last)
        {
            now.gradient_tolerance = kLoose;
            now.checks_stability = false;
        }
        now.max_iterations = std::max(0, options.max_iterations - iterations);
        if (options.time_budget > 0)
            now.time_budget =
                std::max(1e-9, options.time_budget - 1e-3 * ms_since(start));
        if (options.watch)
            now.watch = [&options, iterations](int k, double gradient, double energy)
            { options.watch(iterations + k, gradient, energy); };
        return now;
    };
    SolveReport report = of.solve(options_after(0));
    for (int round = 0; report.stop == Stop::Converged; ++round)
    {
        const double shallow = (round < kRounds ? kShallow : kFair) * of.voxel;
        std::vector<FoundContact> all = of.finder.find(of.poses);
        const bool has_new =
            std::any_of(all.begin(), all.end(),
                        [&](const FoundContact& one)
                        { return one.depth > shallow && !is_known(one, of.contacts); });
        // Contacts that have come free are kept: they would be found again in the next
        // round. One that is well behind its plane but no longer found has passed the
        // end of the plane.
        std::vector<FoundContact> free;
        const auto is_before = [](const FoundContact& a, const FoundContact& b)
        { return a.point < b.point; };
        std::set_difference(of.contacts.begin(), of.contacts.end(), all.begin(),
                            all.end(), std::back_inserter(free), is_before);
        const std::size_t num_past = std::erase_if(
            free,
            [&](const FoundContact& one)
            {
                return contact_gap(one.contact, of.poses[idx(one.contact.a)],
                                   of.poses[idx(one.contact.b)]) < -shallow;
            });
        const bool goes_on = has_new || num_past > 0;
        if (!goes_on && is_last)
            break;
        if (round == kRounds)
        {
            report.stop = Stop::IterationLimit;
            break;
        }
        is_last = is_last || !goes_on || round + 2 >= kRounds;
        const auto middle = all.insert(all.end(), free.begin(), free.end());
        std::inplace_merge(all.begin(), middle, all.end(), is_before);
        take(std::move(all));
        SolveReport next = of.solve(options_after(report.iterations));
        next.add_earlier(report);
        next.energy_before = report.energy_before;
        report = next;
    }
    return report;
}

} // namespace cellwarp::core
