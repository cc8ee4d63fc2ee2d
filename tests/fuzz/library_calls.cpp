// SPDX-License-Identifier: GPL-3.0-or-later
// Random calls of the library, most of them wrong somewhere: `library_calls CALLS
// [SEED]`. Each must end with a result or a documented error, within five seconds. The
// first one that does not is named with the seed of its round.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <string>

#include <unistd.h>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

namespace
{

using Seconds = std::chrono::duration<double>;
using Clock = std::chrono::steady_clock;

constexpr double kLongest = 5.0; // [s] of a call

unsigned seed_of_round = 0;

extern "C" void name_round(int signal)
{
    char text[64];
    const int size = std::snprintf(text, sizeof text, "signal %d in round %u\n", signal,
                                   seed_of_round);
    if (::write(2, text, static_cast<std::size_t>(size)) < 0)
        ::_exit(2);
    ::_exit(1);
}

/// Counts of all calls.
struct Totals
{
    std::size_t calls = 0, solved = 0;
    std::map<std::string, std::size_t> errors;
    double longest = 0.0;
    bool is_good = true;
};

class Round
{
public:
    Round(unsigned seed, Totals& totals) : random_(seed), totals_(totals) {}

    void run()
    {
        const std::optional<Model> model = make_model();
        if (!model)
            return;
        const Edit edit = make_edit(model->num_samples());
        const Settings settings = make_settings();
        if (chance(0.5))
        {
            call([&] { use(*model, deform(*model, edit, settings, control())); });
            return;
        }
        std::optional<Session> session;
        call([&] { session.emplace(*model, edit, settings, control()); });
        if (session)
            play(*session, *model);
    }

private:
    bool chance(double share)
    {
        return std::uniform_real_distribution<double>()(random_) < share;
    }
    std::size_t below(std::size_t count)
    {
        return std::uniform_int_distribution<std::size_t>(0, count - 1)(random_);
    }
    double real(double low, double high)
    {
        return std::uniform_real_distribution<double>(low, high)(random_);
    }
    /// Seldom one that no array should have.
    double number(double wrong)
    {
        constexpr double kStrange[] = {std::numeric_limits<double>::quiet_NaN(),
                                       std::numeric_limits<double>::infinity(),
                                       -std::numeric_limits<double>::infinity(),
                                       1e200,
                                       -1e300,
                                       1e-320,
                                       -1.0,
                                       0.0};
        return chance(wrong) ? kStrange[below(std::size(kStrange))] : real(0.0, 1.0);
    }
    Vec3 vector(double wrong) { return {number(wrong), number(wrong), number(wrong)}; }

    /// A call that may end with an error of the library and nothing else.
    template <class Work>
    bool call(Work&& work)
    {
        ++totals_.calls;
        const Clock::time_point start = Clock::now();
        bool is_done = false;
        try
        {
            work();
            is_done = true;
        }
        catch (const Error& error)
        {
            ++totals_.errors[fault_name(error.fault())];
            if (error.fault() == Fault::Internal)
                fail(error.what());
        }
        catch (const std::bad_alloc&)
        {
            ++totals_.errors["memory"];
        }
        catch (const std::exception& error)
        {
            fail(error.what());
        }
        const double seconds = Seconds(Clock::now() - start).count();
        totals_.longest = std::max(totals_.longest, seconds);
        if (seconds > kLongest)
            fail("took " + std::to_string(seconds) + " s");
        return is_done;
    }
    void fail(const std::string& what)
    {
        totals_.is_good = false;
        std::fprintf(stderr, "round %u: %s\n", seed_of_round, what.c_str());
    }

    /// Shapes of a few samples, anyhow connected, or bars.
    std::optional<Model> make_model()
    {
        const double wrong = chance(0.4) ? 0.02 : 0.0;
        const std::size_t n = chance(0.05) ? below(3) : 4 + below(60);
        std::vector<double> samples(3 * n);
        for (double& x : samples)
            x = number(wrong);
        std::vector<std::int64_t> corners;
        std::vector<std::uint64_t> ends;
        const bool is_box = chance(0.4);
        if (is_box)
            make_box(samples, corners, ends);
        else if (chance(0.7) && n > 0)
            for (std::size_t f = below(2 * n); f > 0; --f)
            {
                for (std::size_t k = 3 + (chance(0.2) ? below(3) : 0); k > 0; --k)
                    corners.push_back(static_cast<std::int64_t>(below(n)) +
                                      (chance(wrong) ? 1000 - 2000 * chance(0.5) : 0));
                ends.push_back(corners.size());
            }
        if (!ends.empty() && chance(wrong))
            ends[below(ends.size())] = below(100);
        std::vector<float> floats(samples.begin(), samples.end());
        ShapeView shape;
        if (chance(0.3))
            shape.samples = floats;
        else
            shape.samples = samples;
        shape.faces = FacesView::polygons(std::span<const std::int64_t>(corners), ends);
        std::vector<double> vectors(3 * (samples.size() / 3 + (chance(wrong) ? 1 : 0)));
        for (double& x : vectors)
            x = number(wrong);
        if (chance(0.2))
            shape.normals = vectors;
        if (chance(0.1))
            shape.tangents = vectors;
        if (chance(0.05))
            shape.rotations = samples;
        if (chance(0.1))
            shape.groups = {{"group", below(4), below(9)}};
        if (chance(wrong))
            shape.samples.data = nullptr;
        std::optional<Model> model;
        call([&] { model.emplace(shape); });
        return model;
    }
    static void make_box(std::vector<double>& samples, std::vector<std::int64_t>& corners,
                         std::vector<std::uint64_t>& ends)
    {
        samples.clear();
        for (int k = 0; k < 8; ++k)
            samples.insert(samples.end(),
                           {double(k & 1), double(k >> 1 & 1), 2.0 * (k >> 2 & 1)});
        corners = {0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4,
                   2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5};
        for (std::uint64_t end = 4; end <= corners.size(); end += 4)
            ends.push_back(end);
    }

    Selector selector(std::size_t n, double wrong)
    {
        switch (below(9))
        {
        case 0:
            return Selector::sphere(vector(wrong), number(wrong));
        case 1:
            return Selector::capsule(vector(wrong), vector(wrong), number(wrong));
        case 2:
            return Selector::halfspace(vector(wrong), number(wrong));
        case 3:
        {
            std::vector<std::int64_t> indices(below(6));
            for (std::int64_t& index : indices)
                index = static_cast<std::int64_t>(below(n)) - (chance(wrong) ? 100 : 0) +
                        (chance(wrong) ? 1000 : 0);
            return Selector::indices(indices);
        }
        case 4:
        {
            std::vector<std::uint8_t> mask(n + (chance(wrong) ? 3 : 0));
            for (std::uint8_t& entry : mask)
                entry = chance(0.3);
            return Selector::mask(mask);
        }
        case 5:
            return chance(0.5) ? Selector::all() : Selector::group("group");
        default:
        {
            const double low = real(0.0, 0.8);
            return Selector::box({0, 0, low}, {number(wrong) + 1, 1, low + 0.2});
        }
        }
    }
    Operation operation(double wrong)
    {
        switch (below(7))
        {
        case 0:
            return rotate(vector(wrong), 180 * number(wrong));
        case 1:
            return rotate_about(vector(wrong), 90 * number(wrong), vector(wrong));
        case 2:
            return rotate_about_border(vector(wrong), 90 * number(wrong));
        case 3:
        {
            Mat4 rigid = kIdentity;
            rigid[below(4)][below(4)] = number(wrong);
            return matrix(rigid);
        }
        case 4:
            return to(vector(wrong));
        default:
            return translate(vector(wrong));
        }
    }
    SplineLine line(double wrong)
    {
        SplineLine line;
        for (std::size_t k = 2 + below(3); k > 0; --k)
            line.points.push_back(vector(wrong));
        line.form = chance(0.3) ? SplineLine::Form::Control : SplineLine::Form::Through;
        line.is_closed = chance(0.2);
        if (chance(0.8))
            line.radius = number(wrong);
        if (chance(0.3))
            line.stiffness = number(wrong);
        return line;
    }

    Edit make_edit(std::size_t n)
    {
        Edit edit;
        const double wrong = chance(0.5) ? 0.01 : 0.0;
        const char* const names[] = {"a", "b", "c", "two words"};
        const auto name = [&] { return std::string(names[below(std::size(names))]); };
        if (chance(0.7))
            call([&] { edit.use_relative_units(); });
        for (int stage = chance(0.1) ? 2 : 1; stage > 0; --stage)
        {
            call([&] { edit.fixed("foot", Selector::box({-9, -9, -9}, {9, 9, 0.2})); });
            call([&] { edit.handle("head", Selector::box({-9, -9, 0.8}, {9, 9, 9})); });
            for (std::size_t k = below(3); k > 0; --k)
                call(
                    [&]
                    {
                        const Selector where = selector(n, wrong);
                        switch (below(6))
                        {
                        case 0:
                            edit.fixed(name(), where);
                            break;
                        case 1:
                            edit.pin(name(), where);
                            break;
                        case 2:
                            edit.stiff(name(), where, 5 * number(wrong));
                            break;
                        case 3:
                            edit.rod(name(), line(wrong));
                            break;
                        default:
                            edit.handle(name(), where);
                        }
                    });
            for (std::int64_t frame = static_cast<std::int64_t>(below(3)); frame >= 0;
                 --frame)
            {
                call([&] { edit.frame(10 * (2 - stage) + 3 - frame); });
                call([&] { edit.move("head", {operation(wrong)}); });
                if (chance(0.3))
                    call([&] { edit.move(name(), {operation(wrong)}); });
                if (chance(0.1))
                    call([&] { edit.move(name(), kEnd, {operation(wrong)}); });
            }
            if (stage > 1)
                call([&] { edit.commit(); });
        }
        call(
            [&]
            {
                if (Edit::parse(edit.text()).text() != edit.text())
                    fail("the text of an edit parses to another one");
            });
        return edit;
    }

    Settings make_settings()
    {
        Settings settings;
        const double wrong = chance(0.3) ? 0.2 : 0.0;
        settings.cells.across = static_cast<int>(2 + below(5));
        settings.cells.max_depth = static_cast<int>(below(2));
        settings.cells.max_cells = 2000;
        settings.cells.fill = static_cast<Fill>(below(3));
        settings.max_iterations = 30;
        settings.time_budget = 1.0;
        settings.threads = static_cast<int>(below(3));
        if (chance(0.2))
            settings.cells.contact = true;
        if (chance(0.3))
            settings.field = static_cast<FieldKind>(below(4));
        if (chance(wrong))
            settings.cells.gap = number(0.9);
        if (chance(wrong))
            settings.cells.thickness = number(0.9);
        if (chance(wrong))
            settings.cells.threshold = number(0.9);
        if (chance(wrong))
            settings.gradient_tolerance = number(0.9);
        if (chance(wrong))
            settings.cells.max_cells = static_cast<std::int64_t>(below(3));
        if (chance(wrong))
            settings.max_memory = number(0.9);
        if (chance(wrong))
            settings.frame = {
                vector(0.3), {vector(0.3), vector(0.3), vector(0.3)}, vector(0.3)};
        return settings;
    }
    /// Ends a call that would take too long for this test.
    Control control()
    {
        Control control;
        if (chance(0.5))
            control.watch =
                [end = Clock::now() + std::chrono::seconds(3)](const Progress&)
            {
                if (Clock::now() > end)
                    throw Error(Fault::Stopped, "by the fuzzer");
            };
        return control;
    }

    void use(const Model& model, const Result& result)
    {
        ++totals_.solved;
        if (result.deformed.samples().size() != model.samples().size())
            fail("the result has another number of samples");
        for (const double x : result.deformed.samples())
            if (!std::isfinite(x))
                return fail("a sample is not finite");
    }

    void play(Session& session, const Model& model)
    {
        while (session.num_upcoming() > 0)
            if (!call([&] { session.next(true, control()); }))
                break;
        totals_.solved += !session.frames().empty();
        call([&] { session.cells(); });
        call([&] { session.rods(); });
        call([&] { session.borders(); });
        call(
            [&]
            {
                const Field field = session.field();
                std::vector<double> places(3 * (1 + below(50)) + (chance(0.1) ? 1 : 0));
                for (double& x : places)
                    x = number(0.05);
                field.apply(places);
            });
        if (chance(0.3))
            call(
                [&]
                {
                    Drag drag(session);
                    Mat4 motion = kIdentity;
                    motion[0][3] = number(0.2);
                    drag.move(chance(0.9) ? "head" : "foot", motion);
                    drag.frame();
                    std::vector<float> shown(model.samples().size());
                    drag.copy_samples(shown);
                });
        if (chance(0.5))
            call([&] { session.set_edit(make_edit(model.num_samples()), control()); });
        call([&] { session.next(true, control()); });
    }

    std::mt19937 random_;
    Totals& totals_;
};

} // namespace

int main(int count, char** words)
{
    const std::size_t calls = count > 1 ? std::strtoull(words[1], nullptr, 10) : 2000;
    seed_of_round = count > 2 ? unsigned(std::strtoul(words[2], nullptr, 10)) : 1;
    std::signal(SIGABRT, name_round);
    std::signal(SIGSEGV, name_round);
    Totals totals;
    for (; totals.calls < calls; ++seed_of_round)
        Round(seed_of_round, totals).run();
    std::printf("%zu calls, %zu shapes solved, longest %.2f s\n", totals.calls,
                totals.solved, totals.longest);
    for (const auto& [name, number] : totals.errors)
        std::printf("%8zu %s\n", number, name.c_str());
    return totals.is_good && totals.solved > 0 ? 0 : 1;
}
