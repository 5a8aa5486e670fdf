// Looks torques up, presses an object through the haptic loop with a device that is only moved here, and solves the equilibrium.
//
//     mcs Press.cs Haptize.cs && mono Press.exe SCENE DATASET Q1 [Q2 ...]

using System;
using System.Globalization;
using System.Linq;
using Haptize;

static class Press
{
    static int Main(string[] arguments)
    {
        CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
        var q = arguments.Skip(2).Select(double.Parse).ToArray();
        var torque = new double[q.Length];
        try
        {
            Console.WriteLine($"version {Handle.Version}");
            LookUp(arguments[1], q, torque);
            Touch(arguments[1], q, torque);
            Solve(arguments[0], q);
            return 0;
        }
        catch (HaptizeException failure)
        {
            Console.Error.WriteLine($"{failure.Code}: {failure.Message}");
            return 1;
        }
    }

    static string Numbers(double[] vector) => string.Join(" ", vector.Select(number => number.ToString("R")));

    static void LookUp(string dataset, double[] q, double[] torque)
    {
        using (var field = Field.Open(dataset))
        {
            var code = field.Torque(q, torque);
            Console.WriteLine($"torque {(int)code} {Numbers(torque)}");
            code = field.Sample(q, out var sample);
            Console.WriteLine($"sample {(int)code} {sample.Status} {sample.Energy:R}");
            var status = new byte[1];
            field.Torques(q, torque, status);
            Console.WriteLine($"torques {status[0]} {Numbers(torque)}");
        }
    }

    // Half a second of the loop, from the grid's corner to q.
    static void Touch(string dataset, double[] q, double[] torque)
    {
        var least = new double[q.Length];
        using (var field = Field.Open(dataset))
            field.Bounds(least, new double[q.Length]);
        using (var loop = Loop.Open(dataset))
        {
            var y = new double[q.Length];
            var (code, tick) = (Code.Ok, default(Tick));
            loop.Start(least);
            var before = GC.GetAllocatedBytesForCurrentThread();
            for (var k = 0; k < 500 && code == Code.Ok; k++)
            {
                for (var joint = 0; joint < y.Length; joint++)
                    y[joint] = least[joint] + (q[joint] - least[joint]) * k / 499.0;
                code = loop.Tick(y, 0.0, loop.Period, torque, out tick);
            }
            var allocated = GC.GetAllocatedBytesForCurrentThread() - before;
            Console.WriteLine($"loop {(int)code} {tick.Contact} {Numbers(torque)}");
            Console.WriteLine($"allocated {allocated}");
            Console.Error.Write(loop.Remarks + loop.Fault);
        }
    }

    static void Solve(string scene, double[] q)
    {
        var forces = new Force[64];
        using (var solver = Solver.Open(scene))
        {
            var code = solver.Solve(q, out var equilibrium, forces);
            Console.WriteLine($"solve {(int)code} {equilibrium.Status} {equilibrium.Torque[0]:R} {equilibrium.Torque[1]:R}");
            var pushed = forces.Take(Math.Min(equilibrium.Forces, forces.Length));
            Console.WriteLine($"force {pushed.Sum(force => force.X):R} {pushed.Sum(force => force.Y):R} {pushed.Sum(force => force.Z):R}");
        }
        using (var live = Live.Open(scene))
        {
            var code = live.Sample(q, out var sample);
            Console.WriteLine($"live {(int)code} {sample.Status} {sample.Torque[0]:R} {sample.Torque[1]:R}");
        }
    }
}
