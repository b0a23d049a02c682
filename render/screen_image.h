#pragma once

#include <vtkActor2D.h>
#include <vtkImageData.h>
#include <vtkImageMapper.h>
#include <vtkNew.h>
#include <vtkRenderer.h>

namespace palpate::render {

/// Puts an image of bytes on the screen as it is, pixel by pixel, behind the texts. Hidden at first.
inline void addScreenImage(vtkRenderer& renderer, vtkImageData* image, vtkActor2D* actor)
{
    vtkNew<vtkImageMapper> mapper;
    mapper->SetInputData(image);
    mapper->SetColorWindow(255);
    mapper->SetColorLevel(127.5);
    actor->SetMapper(mapper);
    actor->SetLayerNumber(0);
    actor->SetVisibility(0);
    renderer.AddActor2D(actor);
}

}  // namespace palpate::render
