// A Flamenco job type: frames of a .blend file that is set to XRDS.
// Lies in the Manager's folder `scripts`. A worker whose Blender lacks XRDS fails its
// task; Blender alone would silently render with another engine.

const JOB_TYPE = {
    label: "XRDS Render",
    description: "Render frames with XRDS, in chunks",
    settings: [
        {
            key: "frames", type: "string", required: true,
            eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
            description: "Frames to render, as 47, 1-30 or 1, 3, 5-10",
        },
        {
            key: "chunk_size", type: "int32", default: 24,
            description: "Frames of one task, which lend each other samples",
        },
        {
            key: "render_output_root", type: "string", subtype: "dir_path",
            required: true, visible: "submission",
            description: "Folder below which the job's own folder is made",
        },
        {
            key: "render_output_path", type: "string", subtype: "file_path",
            editable: false,
            eval: "str(Path(abspath(settings.render_output_root), jobname, '{timestamp}', '######'))",
            description: "Where the frames go",
        },
        { key: "blendfile", type: "string", required: true, visible: "web" },
        {
            key: "format", type: "string", required: true, visible: "web",
            eval: "C.scene.render.image_settings.file_format",
        },
    ],
};

// Run by Blender before the first frame; any exit but 0 fails the task.
const CHECK = [
    "import bpy, sys",
    "missing = not bpy.types.RenderEngine.bl_rna_get_subclass_py('XRDS')",
    "other = bpy.context.scene.render.engine != 'XRDS'",
    "print('XRDS is missing' if missing else 'not set to XRDS' if other else 'XRDS')",
    "sys.exit(3 if missing or other else 0) if missing or other else None",
].join("; ");

function compileJob(job) {
    const settings = job.settings;
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        // Frames of an animation lend each other samples; those of --render-frame do not.
        const which = evenRuns(chunk).flatMap(({ first, last, step }) => [
            "--frame-start", `${first}`, "--frame-end", `${last}`,
            "--frame-jump", `${step}`, "--render-anim",
        ]);
        const task = author.Task(`render-${chunk}`, "blender");
        task.addCommand(author.Command("blender-render", {
            exe: "{blender}",
            exeArgs: "{blenderArgs}",
            argsBefore: [],
            blendfile: settings.blendfile,
            args: [
                "--python-exit-code", "3",
                "--python-expr", CHECK,
                "--render-output", settings.render_output_path,
                "--render-format", settings.format,
                ...which,
            ],
        }));
        job.addTask(task);
    }
}

// The frames of a chunk, as 1-3,8,10,12, as few animations: first, last and step.
function evenRuns(chunk) {
    const runs = [];
    for (const part of chunk.split(",")) {
        const [, first, last] = part.match(/^\s*(-?\d+)(?:-(-?\d+))?\s*$/);
        for (let frame = +first; frame <= +(last ?? first); frame++) {
            const run = runs.at(-1);
            const step = frame - run?.last;
            if (run && (run.first === run.last || step === run.step)) {
                Object.assign(run, { last: frame, step });
            } else if (run && step < run.step && run.last - run.first === run.step) {
                // 3, 8, 9: the 8 belongs to the 9
                runs.push({ first: run.last, last: frame, step });
                Object.assign(run, { last: run.first, step: 1 });
            } else {
                runs.push({ first: frame, last: frame, step: 1 });
            }
        }
    }
    return runs;
}
