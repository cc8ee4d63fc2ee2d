// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes in time: rods, bodies, nets and sheets with a model that rods carry, flesh that
// follows a skeleton, or both. Their parts are the text of a scene file (docs/rods.md,
// docs/flesh.md), the same that `cellwarp simulate` takes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <cellwarp/control.h>
#include <cellwarp/deform.h>
#include <cellwarp/export.h>
#include <cellwarp/model.h>
#include <cellwarp/skeleton.h>

namespace cellwarp
{

/// Measures of a moment, and of the steps since the last frame. What a scene lacks is 0.
struct MotionReport
{
    std::int64_t frame = 0;
    double time = 0.0;                                  ///< [s]
    double kinetic = 0.0, elastic = 0.0, gravity = 0.0; ///< [J]
    Vec3 momentum{}, angular_momentum{};                ///< [kg m/s], [kg m^2/s]
    double violation = 0.0; ///< largest of the constraints [m, rad]
    std::int64_t iterations = 0;
    int contacts = 0;            ///< pairs of places of rods that touch
    Vec3 support{}, pull{};      ///< forces of obstacles and of a hand on the flesh [N]
    double largest_strain = 0.0; ///< of the flesh
    std::size_t inverted = 0;    ///< cells of the flesh that are turned inside out
    double step_ms = 0.0;        ///< of the flesh, all steps together
    std::string stop;            ///< of the first solve that did not converge
    std::vector<std::string> problems; ///< of all that did not converge, as sentences
    bool is_converged = false;
};

/// A rod, or a piece of one that was cut: "rope.1".
struct MovingRod
{
    std::string name;
    double length = 0.0; ///< [m]
    std::vector<double>
        places; ///< three numbers each, at equal shares of the rest length [m]
    std::vector<double> sliding; ///< shares at which something slides
};

struct MovingBody
{
    std::string name;
    Mat4 pose = kIdentity; ///< from the body's own axes [m]
};

struct MovingNet
{
    std::string name;
    std::vector<double> places; ///< three numbers each [m]
};

struct MovingSheet
{
    std::string name;
    std::vector<double> places; ///< three numbers each, the first side fastest [m]
};

/// One thread at a time. The same bits for every number of threads, whatever is looked
/// at.
class CELLWARP_API Simulation
{
public:
    /// A scene file; a scene's text, whose files count from \p folder. Both begin at
    /// frame 0 and throw Fault::Usage for a scene without anything in time, Fault::File,
    /// Fault::Malformed with the key ("rods[1].fixed[0].at"), Fault::Unsolvable,
    /// Fault::Budget, Fault::Stopped.
    static Simulation read(const std::string& path, const Control& control = {});
    static Simulation parse(std::string_view scene, const std::string& folder = ".",
                            const Control& control = {});
    Simulation(Simulation&&) noexcept;
    Simulation& operator=(Simulation&&) noexcept;
    ~Simulation();

    std::int64_t frame() const;      ///< that has been reached
    std::int64_t last_frame() const; ///< 1 of a scene that seeks an equilibrium
    double time() const;             ///< [s]
    double unit() const;             ///< length of the model's unit [m]
    std::vector<std::string> warnings() const;

    /// To the next frame; false: there is none. \p wants_samples: of a model that rods
    /// carry. After an error the simulation has ended.
    bool next(bool wants_samples = true, const Control& control = {});
    const MotionReport& report() const; ///< of the last frame; frame 0 has one, too

    /// The model that moves; nothing: the scene has none.
    std::optional<Model> model() const;
    /// Its samples in the last frame. Throws Fault::Usage without a model.
    Deformed deformed();

    std::vector<MovingRod> rods(int places = 64) const; ///< 2 places to 10,000
    std::vector<MovingBody> bodies() const;
    std::vector<MovingNet> nets() const;
    std::vector<MovingSheet>
    sheets(int places = 16) const;          ///< along each side, 2 to 1,000
    std::vector<PosedJoint> joints() const; ///< of the skeleton
    /// Rods as tubes, bodies, nets and sheets as one mesh [m], as `simulate` writes it.
    /// \p around: corners of a tube, 3 to 1,000. The number of samples changes where rods
    /// are cut or get other knots. Throws Fault::Usage for a scene of flesh alone.
    Model surface(int around = 8) const;

    /// Flesh: a hand pulls a sample towards a place [model unit] from the next step on.
    void pull(std::size_t sample, Vec3 place);
    void let_go();

private:
    struct State;
    explicit Simulation(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

} // namespace cellwarp
