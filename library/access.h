// SPDX-License-Identifier: GPL-3.0-or-later
// The values behind the classes of the interface, for each other's sources.
#pragma once

#include <memory>
#include <utility>
#include <vector>

#include <cellwarp/deform.h>
#include <cellwarp/field.h>
#include <cellwarp/session.h>

#include "io/formats/field_file.h"
#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "library/session/drag.h"
#include "library/session/prepared_drag.h"
#include "library/session/session.h"

namespace cellwarp
{

struct Model::Data
{
    std::shared_ptr<const core::GeometryFile> file;
};

struct Selector::Data
{
    core::Selector selector;
};

struct Edit::Data
{
    core::HandleBuilder builder;
};

struct Deformed::Data
{
    std::shared_ptr<const core::DeformedSamples> samples;
};

struct Access
{
    static Model model(std::shared_ptr<const core::GeometryFile> file)
    {
        return Model(std::make_shared<const Model::Data>(Model::Data{std::move(file)}));
    }
    static const std::shared_ptr<const core::GeometryFile>& file(const Model& model)
    {
        return model.data_->file;
    }
    static const core::Geometry& geometry(const Model& model)
    {
        return model.data_->file->geometry;
    }
    static const core::Selector& selector(const Selector& selector)
    {
        return selector.data_->selector;
    }
    static const core::HandleFile& handles(const Edit& edit)
    {
        return edit.data_->builder.file();
    }
    static Deformed deformed(std::shared_ptr<const core::DeformedSamples> samples)
    {
        return Deformed(
            std::make_shared<const Deformed::Data>(Deformed::Data{std::move(samples)}));
    }
    static const core::DeformedSamples& samples(const Deformed& deformed)
    {
        return *deformed.data_->samples;
    }
    static Field field(const core::FieldFile& file);
    /// Where a drag begins; throws Fault::Usage if nothing can be dragged.
    static core::DragSource drag_source(const Session& session);
};

} // namespace cellwarp
