// SPDX-License-Identifier: GPL-3.0-or-later
// A model some of whose cells are carried by rods in time. The rods do not feel it: in
// each frame the other cells find their places without inertia, and the field takes the
// samples along.
#pragma once

#include <memory>
#include <vector>

#include "library/session/session.h"
#include "library/time/object_simulation.h"

namespace cellwarp::core
{

class CarriedModel
{
public:
    /// Rods of \p simulation, which stands at its start, carry cells of \p geometry, a
    /// unit of which is \p unit [m]. Frames of \p handles happen in the simulation's
    /// frames of the same number. Throws Fault::Malformed for others and for commits, and
    /// what Session throws.
    CarriedModel(std::shared_ptr<const Geometry> geometry, HandleFile handles,
                 SessionSettings settings, double unit,
                 const ObjectSimulation& simulation);
    ~CarriedModel();

    /// The next frame: to where the rods of the same simulation are now. Throws what
    /// Session::next_frame() throws.
    void follow(const ObjectSimulation& simulation, bool wants_samples);
    const Session& session() const { return session_; }

private:
    struct Start;
    static std::vector<std::shared_ptr<const Start>> starts_of(const ObjectSimulation&,
                                                               double unit);
    static SessionSettings with_rods(SessionSettings settings, const ObjectSimulation&,
                                     const std::vector<std::shared_ptr<const Start>>&);

    std::vector<std::shared_ptr<const Start>> starts_; ///< of the carriers
    Session session_;
};

} // namespace cellwarp::core
